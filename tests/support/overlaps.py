"""Whether parts of a page lie over one another."""

PARTS = (
    "header button, main button:not(.joints *, .picks *), main input, main canvas[role], "
    ".prompt p, .list, .joints, output"
)
OVERLAPS = """
(selector) => {
  const parts = [...document.querySelectorAll(selector)]
    .filter((part) => part.checkVisibility() && !(part.matches("p, output") && !part.innerText))
    .map((part) => ({ part, box: part.getBoundingClientRect() }));
  const own = (part) => part.closest(".viewer, .figure, .strip") ?? part;
  const name = ({ part }) => part.id || part.innerText || part.ariaLabel || part.className;
  const apart = (a, b) => a.right <= b.left + 1 || b.right <= a.left + 1
    || a.bottom <= b.top + 1 || b.bottom <= a.top + 1;
  const clash = (a, b) => !a.part.contains(b.part) && !b.part.contains(a.part)
    && own(a.part) !== own(b.part) && !apart(a.box, b.box);
  const found = [];
  for (const [n, one] of parts.entries()) {
    if (one.box.left < -1 || one.box.right > innerWidth + 1) found.push(`${name(one)} is cut`);
    const prompt = one.part.closest(".prompt")?.getBoundingClientRect();
    if (prompt && one.box.bottom > prompt.bottom + 1) found.push(`${name(one)} is cut below`);
    for (const other of parts.slice(n + 1))
      if (clash(one, other)) found.push(`${name(one)} lies over ${name(other)}`);
  }
  return found;
}
"""
"""Parts of the page that can be seen and lie on each other, or beyond the window's edge."""
