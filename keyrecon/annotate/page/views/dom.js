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

// "1 click", "2 clicks"
export const counted = (n, word) => `${n} ${word}${n === 1 ? "" : "s"}`;

export const toggle = (element, name, on) => element.classList.toggle(name, Boolean(on));

// The number in a field of text; null when it is empty, NaN when it holds something else.
export function numberIn(field) {
  const text = field.value.trim().replace(",", ".");
  return text ? Number(text) : null;
}

// Fills a field from the project, as it comes to be by commands and other pages, until somebody types in it.
export function followProject(model, field, text) {
  let typed = false;
  const fill = () => {
    if (!typed) field.value = text(model.project);
  };
  field.addEventListener("input", () => (typed = true));
  model.onProject(fill);
  fill();
}

// Sets text only where it differs, so that nothing is laid out anew without need.
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
