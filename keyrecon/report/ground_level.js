// Height of the ground in frame t: of the lower foot in the frames around it, so that the ground does not
// follow each step. `cuts` are the frames with which another shot begins, which may show the player elsewhere.
// NaN where no foot is known.
export function groundLevel(lowest, t, radius, cuts) {
  let [first, last] = [t, t];
  while (first > Math.max(0, t - radius) && !cuts.has(first)) first--;
  while (last < Math.min(lowest.length - 1, t + radius) && !cuts.has(last + 1)) last++;
  const known = Array.from(lowest.slice(first, last + 1)).filter(Number.isFinite);
  return known.reduce((sum, low) => sum + low, 0) / known.length;
}
