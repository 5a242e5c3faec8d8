// Arrays as the report's file holds them: 16-bit steps, of hours of video only every few frames.

// The numbers of all frames; unknown ones become NaN. Between the frames that are held they lie on a
// straight line; where one of the two is unknown, they are those of the nearer.
export function unpack(packed) {
  if (!packed) return null;
  const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
  const whole = new Int16Array(bytes.buffer);
  const held = Float32Array.from(whole, (n) => (n === -32768 ? NaN : n * packed.step));
  const every = packed.every ?? 1,
    count = packed.shape[0],
    width = packed.shape.slice(1).reduce((product, side) => product * side, 1);
  if (every === 1) return { values: held, shape: packed.shape };
  const values = new Float32Array(count * width),
    rows = held.length / width;
  for (let t = 0; t < count; t++) {
    const before = Math.floor(t / every),
      after = Math.min(before + 1, rows - 1),
      share = t / every - before;
    for (let n = 0; n < width; n++) {
      const a = held[before * width + n],
        b = held[after * width + n],
        between = a + share * (b - a);
      values[t * width + n] = Number.isNaN(between) ? (share < 0.5 ? a : b) : between;
    }
  }
  return { values, shape: packed.shape };
}
