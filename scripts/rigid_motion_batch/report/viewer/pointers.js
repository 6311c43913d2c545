/* One finger or button drags, two fingers pinch; places are pixels from the element's corner. */

export function pointers(element, { start, move, pinch, finish }) {
  const down = new Map();
  const place = (event) => {
    const box = element.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };
  const pair = ([a, b] = [...down.values()]) => ({ x: (a.x + b.x) / 2, y: (a.y + b.y) / 2,
    apart: Math.hypot(a.x - b.x, a.y - b.y) || 1 });
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
  for (const name of ["pointerup", "pointercancel"])
    element.addEventListener(name, (event) => down.delete(event.pointerId) && !down.size && finish?.(place(event), event));
}

/* The wheel scrolls the page until the element has the focus, or Ctrl is held. */
export function wheel(element, turn) {
  element.addEventListener("wheel", (event) => {
    if (document.activeElement !== element && !event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    turn(event);
  }, { passive: false });
}
