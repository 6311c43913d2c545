"use strict";

function newVideo() {
  const video = document.createElement("video");
  Object.assign(video, { controls: true, loop: true, muted: true, playsInline: true, preload: "metadata" });
  video.setAttribute("aria-label", "Video: the modes side by side");
  return video;
}

// Videos: the base64 at the end of the page becomes a Blob when its place comes into view.
function showFilm(place) {
  const source = document.getElementById(place.dataset.film);
  if (!source) return;
  const bytes = Uint8Array.from(atob(source.textContent), (c) => c.charCodeAt(0));
  source.remove();
  const video = newVideo();
  video.src = URL.createObjectURL(new Blob([bytes], { type: "video/mp4" })) + "#t=0.001"; // Safari shows no first frame else.
  place.prepend(video);
}

// A video that is still being rendered is looked for until it is there.
function awaitFilm(place) {
  const video = newVideo();
  video.addEventListener("error", () => setTimeout(look, 4000));
  video.addEventListener("loadedmetadata", () => place.replaceChildren(video));
  function look() {
    video.src = `${place.dataset.coming}?${Date.now()}#t=0.001`; // Or the browser remembers that it was not there.
  }
  look();
}

document.querySelectorAll("[data-coming]").forEach(awaitFilm);

const films = new IntersectionObserver(
  (entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting) continue;
      films.unobserve(entry.target);
      showFilm(entry.target);
    }
  },
  { rootMargin: "300px" },
);
document.querySelectorAll("[data-film]").forEach((place) => films.observe(place));

// Tables: a click on a heading sorts by its column, a second one turns the order round.
function sortBy(heading) {
  const table = heading.closest("table");
  const column = heading.cellIndex;
  const down = heading.getAttribute("aria-sort") === "ascending";
  const valueOf = (row) => row.cells[column].dataset.value;
  const compare = heading.classList.contains("number")
    ? (a, b) => Number(valueOf(a)) - Number(valueOf(b)) || 0
    : (a, b) => valueOf(a).localeCompare(valueOf(b));
  const rows = [...table.tBodies[0].rows].sort((a, b) => (down ? compare(b, a) : compare(a, b)));
  for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", down ? "descending" : "ascending");
  table.tBodies[0].append(...rows);
}

document.querySelectorAll("table.sortable thead th").forEach((heading) => {
  const button = document.createElement("button");
  button.type = "button";
  button.append(...heading.childNodes);
  button.addEventListener("click", () => sortBy(heading));
  heading.append(button);
});

// Charts: values under the pointer, or the arrow keys, are read back from the curves' own coordinates.
function axisFrom(text) {
  const [low, high, kind, ...unit] = text.split(" ");
  const [from, to] = [Number(low), Number(high)];
  const valueAt = (share) => (kind === "log" ? from * (to / from) ** share : from + share * (to - from));
  return { valueAt, unit: unit.join(" ") };
}

function pointsOf(curve) {
  const steps = (curve.getAttribute("d").match(/-?\d+/g) || []).map(Number);
  const points = [];
  for (let i = 0, x = 0, y = 0; i < steps.length; i += 2) points.push([(x += steps[i]), (y += steps[i + 1])]);
  return points;
}

function nearest(points, x) {
  let low = 0;
  let high = points.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (points[middle][0] < x) low = middle;
    else high = middle;
  }
  return x - points[low][0] < points[high][0] - x ? low : high;
}

// Where a curve is at x, as drawn; undefined where it is not.
function heightAt(points, x) {
  const [first, last] = [points[0][0], points[points.length - 1][0]];
  if (x < first || x > last) return undefined;
  const after = points.findIndex((point) => point[0] >= x);
  const [right, below] = points[after];
  if (right === x) return below;
  const [left, above] = points[after - 1];
  return above + ((x - left) / (right - left)) * (below - above);
}

function prepare(chart) {
  const box = chart.querySelector("svg[viewBox]").viewBox.baseVal;
  const [xAxis, yAxis] = [axisFrom(chart.dataset.x), axisFrom(chart.dataset.y)];
  const curves = [...chart.querySelectorAll(".curve")].map((curve) => {
    const title = curve.querySelector("title");
    const label = title.textContent;
    title.remove(); // Or the browser's own tooltip would cover the read-out.
    return { label, colour: curve.style.getPropertyValue("--colour"), points: pointsOf(curve) };
  });
  const drawn = curves.filter((curve) => curve.points.length);
  if (!drawn.length) return null;

  const line = document.createElementNS("http://www.w3.org/2000/svg", "line");
  line.setAttribute("class", "crosshair");
  line.setAttribute("y2", "100%");
  const readout = document.createElement("div");
  readout.className = "readout";
  readout.setAttribute("role", "status");
  const xs = [...new Set(drawn.flatMap((curve) => curve.points.map(([x]) => x)))].sort((a, b) => a - b);
  const stops = xs.map((x) => [x]);
  const written = (value, unit) => `${Number(value.toPrecision(3))} ${unit}`.trim();
  let at = -1;

  function show(x) {
    at = nearest(stops, x);
    const share = xs[at] / box.width;
    line.setAttribute("x1", `${share * 100}%`);
    line.setAttribute("x2", `${share * 100}%`);
    const rows = drawn
      .map((curve) => ({ ...curve, y: heightAt(curve.points, xs[at]) }))
      .filter((curve) => curve.y !== undefined)
      .sort((a, b) => a.y - b.y)
      .map((curve) => {
        const row = document.createElement("div");
        const label = document.createElement("span");
        const swatch = document.createElement("i");
        swatch.className = "swatch";
        swatch.style.setProperty("--colour", curve.colour);
        label.append(swatch, curve.label);
        const value = document.createElement("output");
        value.append(written(yAxis.valueAt(1 - curve.y / box.height), yAxis.unit));
        row.append(label, value);
        return row;
      });
    readout.replaceChildren(`${written(xAxis.valueAt(share), xAxis.unit)}`, ...rows);
    chart.append(line);
    chart.parentElement.append(readout);
    const { width } = chart.getBoundingClientRect();
    const left = parseFloat(getComputedStyle(chart.parentElement).paddingLeft);
    const beside = share < 0.5 ? left + share * width + 12 : left + share * width - readout.offsetWidth - 12;
    const most = chart.parentElement.clientWidth - readout.offsetWidth;
    readout.style.left = `${Math.max(0, Math.min(beside, most))}px`;
  }

  function hide() {
    line.remove();
    readout.remove();
  }

  const step = (by) => show(xs[Math.max(0, Math.min(xs.length - 1, at + by))]);
  return { show, hide, step, width: box.width };
}

document.querySelectorAll("svg.chart").forEach((chart) => {
  let reader; // Made at the first look: a page may have a hundred charts.
  const readerOf = () => (reader === undefined ? (reader = prepare(chart)) : reader);
  chart.addEventListener("pointermove", (event) => {
    const { left, width } = chart.getBoundingClientRect();
    const share = (event.clientX - left) / width;
    if (share < 0 || share > 1) readerOf()?.hide();
    else readerOf()?.show(share * reader.width);
  });
  chart.addEventListener("pointerleave", () => reader?.hide());
  chart.addEventListener("blur", () => reader?.hide());
  chart.addEventListener("keydown", (event) => {
    const by = { ArrowRight: 1, ArrowLeft: -1, PageUp: 20, PageDown: -20 }[event.key];
    if (event.key === "Escape") reader?.hide();
    if (by === undefined) return;
    event.preventDefault();
    readerOf()?.step(by);
  });
});

// Navigation: which section is being read.
const places = new Map([...document.querySelectorAll("nav a")].map((link) => [link.hash.slice(1), link]));
const reading = new IntersectionObserver(
  (entries) => {
    for (const { target, isIntersecting } of entries) {
      if (!isIntersecting) continue;
      places.forEach((link) => link.removeAttribute("aria-current"));
      const link = places.get(target.id);
      link.setAttribute("aria-current", "true");
      const list = link.closest("ul");
      list.scrollTo({ left: link.offsetLeft - list.offsetWidth / 2 });
    }
  },
  { rootMargin: "-30% 0px -65% 0px" },
);
document.querySelectorAll("main > section").forEach((section) => reading.observe(section));
