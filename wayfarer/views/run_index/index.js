"use strict";
// Filters and sorts the rows of the index. All that it knows it reads from the table.
(() => {
  const form = document.querySelector(".filters"), table = document.querySelector("table"), body = table.tBodies[0];
  const titles = [...table.tHead.rows[0].cells], column = new Map(titles.map((title, at) => [title.textContent, at]));
  const rows = [...body.rows];
  const text = (row, title) => row.cells[column.get(title)].textContent;
  const order = new Intl.Collator(undefined, { numeric: true });  // so 0:09:00 is before 0:10:00, and 9 before 10

  for (const title of ["outcome", "rover"]) {
    const values = [...new Set(rows.map((row) => text(row, title)))].filter(Boolean).sort(order.compare);
    form.elements[title].append(...values.map((value) => new Option(value)));
  }

  function fits(row) {
    const { search, outcome, rover, from, to, marked } = form.elements, day = text(row, "began").slice(0, 10);
    const dated = /^\d{4}-\d\d-\d\d$/.test(day);
    return search.value.toLowerCase().split(/\s+/).every((word) => row.textContent.toLowerCase().includes(word))
      && (!outcome.value || text(row, "outcome") === outcome.value) && (!rover.value || text(row, "rover") === rover.value)
      && (!from.value || (dated && day >= from.value)) && (!to.value || (dated && day <= to.value))
      && (!marked.checked || text(row, "marks") !== "");
  }

  function filter() {
    for (const row of rows) row.hidden = !fits(row);
    form.querySelector("output").value = `${rows.filter((row) => !row.hidden).length} of ${rows.length} runs`;
  }

  // The first click on a title sorts upwards, the next one downwards; what is not known stands last.
  function sort(title) {
    const down = title.getAttribute("aria-sort") === "ascending" ? -1 : 1, name = title.textContent;
    for (const each of titles) each.removeAttribute("aria-sort");
    title.setAttribute("aria-sort", down > 0 ? "ascending" : "descending");
    rows.sort((a, b) => {
      const [first, second] = [text(a, name), text(b, name)];
      return (first === "") - (second === "") || down * order.compare(first, second);
    });
    body.append(...rows);
  }

  for (const title of titles) {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: title.textContent });
    button.addEventListener("click", () => sort(title));
    title.replaceChildren(button);
  }
  form.addEventListener("input", filter);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.hidden = false;
  filter();
})();
