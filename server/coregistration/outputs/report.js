// Sorts tables by a click on a heading, and opens the plot that a link leads to.
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  [...table.tHead.rows[0].cells].forEach((heading, at) => {
    let up = false;
    heading.addEventListener("click", () => {
      up = !up;
      const value = (row) => row.cells[at].dataset.v ?? row.cells[at].textContent;
      const order = (a, b) => {
        const [p, q] = [value(a), value(b)];
        if (p === "" || q === "") return (p === "") - (q === "");
        const both = p - q;
        return (up ? 1 : -1) * (Number.isNaN(both) ? p.localeCompare(q, undefined, { numeric: true }) : both);
      };
      body.append(...[...body.rows].sort(order));
    });
  });
}
const open = () => {
  const plot = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (plot && plot.tagName === "DETAILS") {
    plot.open = true;
    plot.scrollIntoView();
  }
};
addEventListener("hashchange", open);
open();
