/* Tables: a click on a heading sorts by its column, a second one turns the order round; rows are found by name. */
const { compare } = new Intl.Collator("en", { numeric: true }), order = (a, b) => a - b || compare(a, b);

document.addEventListener("click", ({ target }) => {
  const heading = target.closest("table.sortable thead th");
  if (!heading) return;
  const down = heading.ariaSort === "ascending", body = heading.closest("table").tBodies[0], column = heading.cellIndex;
  const value = ({ cells }) => cells[column].dataset.value ?? cells[column].textContent;
  const rows = [...body.rows].map((row) => [value(row), row]).sort(([a], [b]) => (down ? order(b, a) : order(a, b)));
  for (const other of heading.parentNode.cells) other.ariaSort = "none";
  heading.ariaSort = down ? "descending" : "ascending";
  body.append(...rows.map(([, row]) => row));
});

document.querySelector("[type=search]")?.addEventListener("input", ({ target }) => {
  const rows = [...document.querySelectorAll("#overview tbody tr")], words = target.value.toLowerCase().split(/\s+/);
  for (const row of rows) row.hidden = !words.every((word) => row.cells[0].textContent.toLowerCase().includes(word));
  document.getElementById("found").textContent = `${rows.filter((row) => !row.hidden).length} of ${rows.length}`;
});
