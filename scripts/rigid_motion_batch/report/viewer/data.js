/* Clips as data.py packs them. Times are seconds from the clip's first sample, errors in mm, mm and degrees. */

export async function inflate(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/* The rows of an array: whole numbers of a step, as differences, the lowest bytes of all numbers first. */
export function unpack(bytes, [offset, rows, n, step, width]) {
  const count = rows * n, lost = 32 - 8 * width;
  const values = new (width === 4 ? Float64Array : Float32Array)(count);
  for (let row = 0, k = 0; row < rows; row++) {
    let whole = 0;
    for (let i = 0; i < n; i++, k++) {
      let difference = 0;
      for (let b = 0; b < width; b++) difference |= bytes[offset + b * count + k] << (8 * b);
      whole = ((whole + difference) << lost) >> lost;
      values[k] = whole * step;
    }
  }
  return Array.from({ length: rows }, (_, row) => values.subarray(row * n, (row + 1) * n));
}

export async function readRecording({ block, times, seen, places, turns, scales }) {
  const bytes = await inflate(block), read = (one) => one && unpack(bytes, one), [all] = read(times);
  const moments = read(seen)[0].map((i) => all[i]);
  return { times: all, moments, places: read(places), turns: read(turns), scales: read(scales) };
}

export async function readChoice({ block, first, count, every, seen, ...choice }, { times, moments }) {
  const bytes = await inflate(block), read = (one) => one && unpack(bytes, one);
  const own = times.subarray(first, first + count);
  return { ...choice, seen: seen[0], moments: moments.subarray(seen[0], seen[0] + seen[1]),
    begin: own[0], end: own[count - 1], times: own.filter((_, i) => i % every === 0),
    motions: choice.motions.map(({ errors, keys, away, turn, grown, by_joint, ...motion }) => ({ ...motion,
      errors: errors.map((one) => read(one)[0]), keys: Array.from(read(keys)[0], (i) => own[i]),
      away: read(away), turn: read(turn), grown: read(grown), byJoint: read(by_joint) })) };
}

/* The sample at or before a time, and how far on the way to the next. */
export function at(times, t) {
  let low = 0, high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle; else high = middle;
  }
  if (t >= times[high]) return [high, 0];
  return [low, Math.max(0, (t - times[low]) / (times[high] - times[low]))];
}

export const valueAt = (times, values, t, [i, share] = at(times, t)) =>
  (share ? values[i] * (1 - share) + values[i + 1] * share : values[i]);
export const highest = (values) => values.reduce((best, value, i) => (value > values[best] ? i : best), 0);

/* Samples from one to another as at most about so many points [sample, value]: the extremes of every few of them. */
export function polyline(values, first, last, most) {
  const step = Math.max(1, Math.ceil((2 * (last - first)) / most)), points = [];
  for (let i = first; i <= last; i += step) {
    let [low, high] = [i, i];
    for (let k = i + 1; k < i + step && k <= last; k++)
      if (values[k] < values[low]) low = k; else if (values[k] > values[high]) high = k;
    for (const k of new Set([Math.min(low, high), Math.max(low, high)])) points.push([k, values[k]]);
  }
  return points;
}
