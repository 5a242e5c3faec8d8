// Draws the charts of a swing report in the colours of the present scheme.
"use strict";
(() => {
  const style = () => getComputedStyle(document.documentElement);

  // Replaces "var(--name)" by the colour of the present scheme, anywhere in a figure.
  function paint(value) {
    if (typeof value === "string") {
      return value.replace(/^var\((--\w+)\)$/, (_, name) => style().getPropertyValue(name).trim());
    }
    if (Array.isArray(value)) return value.map(paint);
    if (value && value.constructor === Object) {
      return Object.fromEntries(Object.entries(value).map(([key, part]) => [key, paint(part)]));
    }
    return value;
  }

  function draw() {
    for (const element of document.querySelectorAll(".chart")) {
      const source = document.getElementById(`chart-${element.dataset.chart}`);
      const figure = paint(JSON.parse(source.textContent));
      Plotly.react(element, figure.data, figure.layout, { displayModeBar: false, responsive: true });
    }
  }

  addEventListener("DOMContentLoaded", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
})();
