/* One finger or button drags, two fingers pinch; places are pixels from the element's corner. */

export function pointers(element, { start, move, pinch, finish }) {
  const down = new Map();
  const place = (event) => {
    const box = element.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };
  const pair = ([{ x, y }, to] = [...down.values()]) =>
    ({ x: (x + to.x) / 2, y: (y + to.y) / 2, apart: Math.hypot(x - to.x, y - to.y) });
  element.addEventListener("pointerdown", (event) => {
    element.setPointerCapture(event.pointerId);
    element.focus({ preventScroll: true });
    down.set(event.pointerId, place(event));
    if (down.size === 1) start?.(place(event), event);
  });
  element.addEventListener("pointermove", (event) => {
    const old = down.get(event.pointerId), both = down.size === 2 ? pair() : null;
    if (!old) return;
    down.set(event.pointerId, place(event));
    if (both) pinch(both, pair()); else if (down.size === 1) move(place(event), old, event);
  });
  const up = (event) => down.delete(event.pointerId) && !down.size && finish?.(place(event), event);
  ["pointerup", "pointercancel"].forEach((name) => element.addEventListener(name, up));
}

/* The wheel scrolls the page until the element has the focus, or Ctrl is held. */
export function wheel(element, turn) {
  element.addEventListener("wheel", (event) => {
    if (document.activeElement === element || event.ctrlKey || event.metaKey) [event.preventDefault(), turn(event)];
  }, { passive: false });
}
