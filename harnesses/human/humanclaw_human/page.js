// Shows the view and the text that a model gets; sends calls by key, button or form.
// @ts-check
"use strict";

/** @typedef {{name: string, type: string, description: string, minimum?: number, maximum?: number, value: any}} Parameter */
/** @typedef {{skill: string, params: Record<string, any>}} Call */
/** @typedef {Call & {words: string}} Key */
/** @typedef {{name: string, description: string, parameters: Parameter[]}} Skill */
/** @typedef {{keys: Record<string, Key>, skills: Skill[]}} Controls */
/** @typedef {{step: number, of: number, instruction: string, feedback: string, past: [string, string][], between: number, result?: string}} PageState */

{
  const at = (/** @type {string} */ id) => /** @type {HTMLElement} */ (document.getElementById(id));
  const { keys, skills } = /** @type {Controls} */ (JSON.parse(at("controls").textContent ?? ""));
  const seen = /** @type {HTMLInputElement} */ (at("seen"));
  const skill = /** @type {HTMLSelectElement} */ (at("skill"));
  /** @type {Record<string, string>} */
  const signs = { ArrowUp: "↑", ArrowDown: "↓", ArrowLeft: "←", ArrowRight: "→" };
  let shown = "";

  /** @template {keyof HTMLElementTagNameMap} T @param {T} tag @param {string} text @returns {HTMLElementTagNameMap[T]} */
  const made = (tag, text = "") => Object.assign(document.createElement(tag), { textContent: text });

  /** Send a call or that the person leaves, and show an error. @param {"call" | "leave"} place @param {string} words @param {Call} [call] */
  async function send(place, words, call) {
    if (at("acting").hidden) return;
    const before = at("step").textContent;
    at("step").textContent = words;
    const body = call && JSON.stringify({ skill: call.skill, params: call.params, seen: seen.value });
    const answer = await fetch(place, { method: "POST", body });
    at("hint").textContent = answer.ok ? "" : await answer.text();
    if (answer.ok) seen.value = "";
    else at("step").textContent = before;
  }

  /** @param {Key} key */
  const press = (key) => send("call", `The body moves: ${key.words}`, key);

  /** Return the value of a parameter as JSON has it. @param {HTMLInputElement} input */
  const value = (input) => (input.type === "checkbox" ? input.checked : input.type === "number" ? Number(input.value) : input.value);

  function choose() {
    const chosen = skills[skill.selectedIndex];
    at("described").textContent = chosen.description;
    at("parameters").replaceChildren(...chosen.parameters.map((part) => {
      const label = made("label"), input = made("input");
      const type = { string: "text", boolean: "checkbox" }[part.type] ?? "number";
      Object.assign(input, { type, min: part.minimum, max: part.maximum, value: part.value, required: type !== "checkbox" });
      if (type === "checkbox") input.checked = part.value === true;
      label.append(input, `${part.name}: ${part.description}`);
      return label;
    }));
  }

  /** Show the half second that led here, at its own speed, and then the view. @param {PageState} now */
  function move(now) {
    const view = /** @type {HTMLImageElement} */ (at("view")), still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    const moving = still ? [] : Array.from({ length: now.between }, (_, k) => `between-${k}.jpg`);
    [...moving, "view.jpg"].forEach((name, k, all) => {
      const frame = new Image(); // Loaded ahead, so that each one appears in time.
      frame.src = `${name}?${now.step}-${Date.now()}`;
      setTimeout(() => (view.src = frame.src), (500 * (k + 1)) / all.length);
    });
  }

  /** @param {PageState} now */
  function show(now) {
    move(now);
    at("instruction").textContent = now.instruction;
    at("step").textContent = `Step ${now.step} of ${now.of}`;
    at("feedback").textContent = now.feedback;
    at("past").replaceChildren(...now.past.map(([call, result]) => made("li", `${call}: ${result}`)));
  }

  /** Nothing can be called any more. @param {string} result @param {...(string | Node)} hint */
  function end(result, ...hint) {
    at("step").textContent = "The episode has ended.";
    at("feedback").textContent = result;
    at("hint").replaceChildren(...hint);
    at("acting").hidden = at("leave").hidden = true;
  }

  /** Return a link to the replay once it is written. This page keeps a copy, since the server ends soon. */
  async function replay() {
    const answer = await fetch("replay");
    if (!answer.ok) return "The replay is being made.";
    return Object.assign(made("a", "Watch the replay"), { href: URL.createObjectURL(await answer.blob()), target: "_blank" });
  }

  async function follow() {
    const ended = at("acting").hidden;
    try {
      const told = await (await fetch("state", { cache: "no-store" })).text();
      const now = /** @type {PageState} */ (JSON.parse(told));
      if (ended && !now.result) location.reload(); // Another episode is served here.
      if (now.result) end(now.result, await replay());
      else if (told !== shown && now.step >= 0) show(now);
      shown = told;
    } catch (error) {
      if (!ended) end("", "Its result and replay stand in the terminal. The next episode of a run appears here or in a new page.");
    }
    if (!at("hint").querySelector("a")) setTimeout(follow, 200);
  }

  at("keys").append(...Object.entries(keys).map(([name, key]) => {
    const button = made("button");
    button.setAttribute("aria-keyshortcuts", name); // A screen reader says the words, then the key.
    button.setAttribute("aria-label", key.words);
    button.append(made("kbd", name.replace("Shift+", "⇧ ").replace(/Arrow\w+/, (arrow) => signs[arrow])), key.words);
    button.title = key.skill;
    button.type = "button";
    button.addEventListener("click", () => press(key));
    return button;
  }));
  document.addEventListener("keydown", (event) => {
    const name = event.key.length > 1 ? event.key : event.key.toLowerCase(); // Caps Lock may be on.
    const key = keys[(event.shiftKey ? "Shift+" : "") + name];
    const typing = event.target instanceof Element && event.target.closest("input, select");
    if (!key || typing || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    press(key);
  });
  skill.append(...skills.map(({ name }) => made("option", name)));
  skill.addEventListener("change", choose);
  if (skills.length) choose();
  at("call").addEventListener("submit", (event) => {
    event.preventDefault();
    const inputs = [...at("parameters").querySelectorAll("input")], parts = skills[skill.selectedIndex].parameters;
    const params = Object.fromEntries(inputs.map((input, k) => [parts[k].name, value(input)]));
    send("call", `The body moves: ${skill.value}`, { skill: skill.value, params });
  });
  at("leave").addEventListener("click", () => send("leave", "You leave the episode."));
  follow();
  document.documentElement.dataset.ready = "yes";
}
