// SPDX-License-Identifier: Apache-2.0. A click on a column's title sorts the table by it, another click the other way round.
(() => {
  "use strict";
  // The first number of a cell, milliseconds as seconds; "∞" is one, "–" is none.
  const numberOf = (text) => {
    if (text.startsWith("∞")) return Infinity;
    const found = text.match(/[-−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?/i);
    if (!found) return NaN;
    const value = parseFloat(found[0].replace("−", "-"));
    return /\d\s*ms\b/.test(text) ? value / 1000 : value;
  };
  const sortBy = (table, column, isNumeric, isDescending) => {
    const body = table.tBodies[0];
    const text = (row) => row.cells[column].textContent.trim();
    const compare = (a, b) => {
      let order = 0;
      if (isNumeric) {
        const [x, y] = [numberOf(text(a)), numberOf(text(b))];
        if (Number.isNaN(x) || Number.isNaN(y)) return Number.isNaN(x) - Number.isNaN(y);  // what has no number stays last
        order = x < y ? -1 : x > y ? 1 : 0;
      } else {
        order = text(a).localeCompare(text(b), "en", { numeric: true });
      }
      return isDescending ? -order : order;
    };
    body.append(...[...body.rows].sort(compare));
  };

  for (const table of document.querySelectorAll("table")) {
    if (table.tBodies[0].rows.length < 2) continue;
    const titles = [...table.tHead.rows[0].cells];
    titles.forEach((title, column) => {
      const button = document.createElement("button");
      button.type = "button";
      button.title = "Sort by this column";
      button.append(...title.childNodes);
      title.append(button);
      button.addEventListener("click", () => {
        const isDescending = title.getAttribute("aria-sort") === "ascending";
        titles.forEach((other) => other.removeAttribute("aria-sort"));
        title.setAttribute("aria-sort", isDescending ? "descending" : "ascending");
        sortBy(table, column, title.classList.contains("number"), isDescending);
      });
    });
  }
})();
