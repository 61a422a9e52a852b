// Shows the runs of a group that are asked for, in the table and among the maps.
"use strict";
{
  const text = document.getElementById("filter-text");
  const verdict = document.getElementById("filter-verdict");
  const rows = [...document.querySelectorAll("table.runs tbody tr")];
  const squares = new Map([...document.querySelectorAll(".square")].map((s) => [s.dataset.run, s]));
  const show = () => {
    const wanted = text.value.trim().toLowerCase();
    let shown = 0;
    for (const row of rows) {
      const states = row.dataset.state.split(" ");
      const is = row.dataset.label.includes(wanted) && (verdict.value === "" || states.includes(verdict.value));
      row.hidden = !is;
      const square = squares.get(row.dataset.run);
      if (square) square.hidden = !is;
      shown += is ? 1 : 0;
    }
    document.getElementById("filter-count").textContent = shown < rows.length ? `${shown} of ${rows.length}` : "";
  };
  if (text && verdict) {
    text.addEventListener("input", show);
    verdict.addEventListener("change", show);
  }
}
