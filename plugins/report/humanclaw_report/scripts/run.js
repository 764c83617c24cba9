// The grid of episodes: filters and order.
// Cards are laid out as they come near the window, so a run of 1,218 episodes opens as fast as one of 50.
// @ts-check
"use strict";

{
  const form = /** @type {HTMLFormElement} */ (document.getElementById("filters"));
  const list = /** @type {HTMLUListElement} */ (document.getElementById("list"));
  const rest = /** @type {HTMLTemplateElement} */ (document.getElementById("rest"));
  const more = /** @type {HTMLButtonElement} */ (document.getElementById("more"));
  const order = /** @type {HTMLSelectElement} */ (document.getElementById("sort"));
  const few = list.children.length;
  const cards = /** @type {HTMLElement[]} */ ([...list.children, ...rest.content.children]);
  /** Cards that pass the filter, in the order in which they are shown. */
  let found = cards;
  /** @type {Map<HTMLElement, string>} */
  const texts = new Map();

  /** @param {HTMLElement} card */
  const textOf = (card) => {
    const text = texts.get(card) ?? (card.textContent ?? "").toLowerCase();
    texts.set(card, text);
    return text;
  };

  /** Tell whether a card has every wanted value. @param {HTMLElement} card @param {[string, string][]} wanted */
  const fits = (card, wanted) =>
    wanted.every(([name, value]) =>
      name === "text" ? textOf(card).includes(value.toLowerCase()) : (card.dataset[name] ?? "").split("|").includes(value),
    );

  /** Show this many of the found cards. @param {number} count */
  const show = (count) => {
    list.replaceChildren(...found.slice(0, count));
    more.hidden = count >= found.length;
    more.textContent = `Show more: ${list.children.length} of ${found.length.toLocaleString("en")} shown`;
  };

  /** Return cards by the chosen value. The order of the page is kept among equals. @param {HTMLElement[]} some */
  const sorted = (some) => {
    if (!order.value) return some;
    const compare = new Intl.Collator("en", { numeric: true }).compare;
    return [...some].sort((a, b) => compare(a.dataset[order.value] ?? "", b.dataset[order.value] ?? ""));
  };

  const filter = () => {
    const wanted = /** @type {[string, string][]} */ ([...new FormData(form)].filter(([, value]) => value));
    found = sorted(cards.filter((card) => fits(card, wanted)));
    show(few);
    const [count, all] = [found.length, cards.length].map((number) => number.toLocaleString("en"));
    /** @type {HTMLOutputElement} */ (document.getElementById("count")).value = `${count} of ${all} episode${cards.length === 1 ? "" : "s"}`;
    history.replaceState(null, "", wanted.length ? `#${new URLSearchParams(wanted)}` : location.pathname);
  };

  more.addEventListener("click", () => show(list.children.length + few));
  new IntersectionObserver(([last]) => last.isIntersecting && more.click(), { rootMargin: "600px" }).observe(more);
  window.addEventListener("beforeprint", () => show(found.length));
  form.addEventListener("input", filter);
  form.addEventListener("reset", () => setTimeout(filter));
  form.addEventListener("submit", (event) => event.preventDefault());
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
