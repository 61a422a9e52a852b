// Sorts tables: a click on a heading orders the rows by it, a second click the other way round.
"use strict";
document.documentElement.classList.add("has-script");

for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    head.tabIndex = 0;
    head.addEventListener("click", () => sortBy(table, heads, column));
    head.addEventListener("keydown", (event) => {
      if (event.key === "Enter") sortBy(table, heads, column);
    });
  });
}

function sortBy(table, heads, column) {
  const isNumber = heads[column].classList.contains("n");
  const wasUp = heads[column].getAttribute("aria-sort") === "ascending";
  const rows = [...table.tBodies[0].rows];
  const keys = new Map(rows.map((row) => [row, keyOf(row.cells[column].textContent.trim(), isNumber)]));
  rows.sort((a, b) => compare(keys.get(a), keys.get(b), wasUp ? -1 : 1));
  heads.forEach((head) => head.removeAttribute("aria-sort"));
  heads[column].setAttribute("aria-sort", wasUp ? "descending" : "ascending");
  table.tBodies[0].append(...rows);
}

function keyOf(text, isNumber) {
  if (!isNumber) return text;
  const number = parseFloat(text.replace("under", ""));
  return Number.isNaN(number) ? null : number;
}

// What is not there stands last either way.
function compare(a, b, sign) {
  if (a === null || b === null) return (a === null) - (b === null);
  return sign * (typeof a === "number" ? a - b : a.localeCompare(b, "en"));
}
