// Elements from a tag, properties and children; text is always text.

export const byId = (id) => document.getElementById(id);

export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name === "data") Object.assign(element.dataset, value);
    else if (name.startsWith("aria-") || name === "role" || name === "for")
      element.setAttribute(name, value);
    else element[name] = value;
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

export const toggle = (element, name, on) => element.classList.toggle(name, Boolean(on));

// The number in a field of text; null when it is empty, NaN when it holds something else.
export function numberIn(field) {
  const text = field.value.trim().replace(",", ".");
  return text ? Number(text) : null;
}

// Sets text only where it differs, so that nothing is laid out anew without need.
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// The pen of a canvas that is as sharp as the screen, cleared; also its size in CSS pixels.
export function penOf(canvas) {
  const ratio = window.devicePixelRatio || 1,
    { clientWidth: width, clientHeight: height } = canvas;
  const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== wide || canvas.height !== high)
    Object.assign(canvas, { width: wide, height: high });
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return [pen, width, height];
}

export function color(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}
