// The list of episodes: filters, sorting, and a preview of each episode's last view.
// Rows are laid out as they come near the window, so a run of 1,218 episodes opens as fast as one of 50.
// @ts-check
"use strict";

{
  const form = /** @type {HTMLFormElement} */ (document.getElementById("filters"));
  const table = /** @type {HTMLTableElement} */ (document.getElementById("list"));
  const rest = /** @type {HTMLTemplateElement} */ (document.getElementById("rest"));
  const more = /** @type {HTMLButtonElement} */ (document.getElementById("more"));
  const body = table.tBodies[0];
  const few = body.rows.length;
  const rows = [...body.rows, .../** @type {NodeListOf<HTMLTableRowElement>} */ (rest.content.querySelectorAll("tr"))];
  /** Rows that pass the filter, in the order in which they are shown. */
  let found = rows;
  /** @type {Map<HTMLTableRowElement, string>} */
  const texts = new Map();

  /** @param {HTMLTableRowElement} row */
  const textOf = (row) => {
    const text = texts.get(row) ?? (row.textContent ?? "").toLowerCase();
    texts.set(row, text);
    return text;
  };

  /** Tell whether a row has every wanted value. @param {HTMLTableRowElement} row @param {[string, string][]} wanted */
  const fits = (row, wanted) =>
    wanted.every(([name, value]) =>
      name === "text" ? textOf(row).includes(value.toLowerCase()) : (row.dataset[name] ?? "").split("|").includes(value),
    );

  /** Show this many of the found rows. @param {number} count */
  const show = (count) => {
    body.replaceChildren(...found.slice(0, count));
    more.hidden = count >= found.length;
    more.textContent = `Show more: ${body.rows.length} of ${found.length.toLocaleString("en")} shown`;
  };

  const filter = () => {
    const wanted = /** @type {[string, string][]} */ ([...new FormData(form)].filter(([, value]) => value));
    found = rows.filter((row) => fits(row, wanted));
    show(few);
    const [count, all] = [found.length, rows.length].map((number) => number.toLocaleString("en"));
    /** @type {HTMLOutputElement} */ (document.getElementById("count")).value = `${count} of ${all} episode${rows.length === 1 ? "" : "s"}`;
    history.replaceState(null, "", wanted.length ? `#${new URLSearchParams(wanted)}` : location.pathname);
  };

  /** @param {HTMLTableCellElement} cell */
  const keyOf = (cell) => cell.dataset.key ?? cell.textContent ?? "";

  /** @param {HTMLTableCellElement} head */
  const sort = (head) => {
    const down = head.getAttribute("aria-sort") === "ascending";
    for (const other of head.parentElement?.children ?? []) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const compare = new Intl.Collator("en", { numeric: true }).compare;
    const keys = new Map(rows.map((row) => [row, keyOf(row.cells[head.cellIndex])]));
    rows.sort((a, b) => (down ? -1 : 1) * compare(keys.get(a) ?? "", keys.get(b) ?? ""));
    filter();
  };

  more.addEventListener("click", () => show(body.rows.length + few));
  new IntersectionObserver(([last]) => last.isIntersecting && more.click(), { rootMargin: "600px" }).observe(more);
  window.addEventListener("beforeprint", () => show(found.length));

  const peek = /** @type {HTMLElement} */ (document.getElementById("peek"));
  const picture = /** @type {HTMLImageElement} */ (peek.querySelector("img"));
  /** @param {Event} event */
  const look = (event) => {
    const link = event.target instanceof Element ? event.target.closest("a[data-picture]") : null;
    const source = link instanceof HTMLElement ? link.dataset.picture : "";
    peek.hidden = !source;
    if (!source || !link) return;
    picture.src = source;
    const box = link.getBoundingClientRect();
    peek.style.top = `${Math.max(8, Math.min(innerHeight - 210, box.top - 70))}px`;
    peek.style.left = `${box.right + 180 < innerWidth ? box.right + 12 : Math.max(8, box.left - 180)}px`;
  };

  form.addEventListener("input", filter);
  form.addEventListener("reset", () => setTimeout(filter));
  form.addEventListener("submit", (event) => event.preventDefault());
  for (const head of table.tHead?.rows[0].cells ?? []) head.querySelector("button")?.addEventListener("click", () => sort(head));
  for (const kind of ["mouseover", "focusin"]) table.addEventListener(kind, look);
  for (const kind of ["mouseleave", "focusout"]) table.addEventListener(kind, () => (peek.hidden = true));
  if (location.hash.includes("=")) {
    for (const [name, value] of new URLSearchParams(location.hash.slice(1))) {
      const field = form.elements.namedItem(name);
      if (field instanceof HTMLInputElement && field.type === "checkbox") field.checked = true;
      else if (field instanceof HTMLInputElement || field instanceof HTMLSelectElement) field.value = value;
    }
    filter();
  }
  show(few);
  document.documentElement.dataset.ready = "yes";
}
