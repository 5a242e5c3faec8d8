// Arrays as the report's file holds them: 16-bit steps, of hours of video only every few frames.

// The numbers of all frames; unknown ones become NaN. Between the frames that are held they lie on a
// straight line; where one of the two is unknown, they are those of the nearer. `cuts` are frames with
// which another shot begins: there they are those of the one in the same shot, and of none unknown.
export function unpack(packed, cuts = new Set()) {
  if (!packed) return null;
  const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
  const whole = new Int16Array(bytes.buffer);
  const held = Float32Array.from(whole, (n) => (n === -32768 ? NaN : n * packed.step));
  const every = packed.every ?? 1,
    count = packed.shape[0],
    width = packed.shape.slice(1).reduce((product, side) => product * side, 1);
  if (every === 1) return { values: held, shape: packed.shape };
  const values = new Float32Array(count * width).fill(NaN),
    rows = held.length / width,
    shot = shotNumbers(count, cuts);
  for (let t = 0; t < count; t++) {
    const rowsBeside = [Math.floor(t / every), Math.min(Math.floor(t / every) + 1, rows - 1)],
      own = rowsBeside.filter((row) => shot[row * every] === shot[t]),
      before = own[0],
      after = own.at(-1),
      share = before === after ? 0 : t / every - before;
    if (!own.length) continue;
    for (let n = 0; n < width; n++) {
      const a = held[before * width + n],
        b = held[after * width + n],
        between = a + share * (b - a);
      values[t * width + n] = Number.isNaN(between) ? (share < 0.5 ? a : b) : between;
    }
  }
  return { values, shape: packed.shape };
}

// The shot of every frame, counted from 0.
function shotNumbers(count, cuts) {
  let shot = 0;
  return Int32Array.from({ length: count }, (_, t) => (shot += cuts.has(t) ? 1 : 0));
}
