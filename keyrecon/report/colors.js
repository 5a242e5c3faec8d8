// Colours by the names that the style sheet gives them, in the present scheme, light or dark.

export const cssColor = (name) =>
  getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// A figure of plotly with "var(--name)" replaced by the colour itself, anywhere in it.
export function painted(value) {
  if (typeof value === "string")
    return value.replace(/^var\(--([\w-]+)\)$/, (_, name) => cssColor(name));
  if (Array.isArray(value)) return value.map(painted);
  if (value && value.constructor === Object)
    return Object.fromEntries(Object.entries(value).map(([key, part]) => [key, painted(part)]));
  return value;
}
