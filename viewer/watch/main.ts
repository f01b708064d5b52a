// The page of `conevo watch`: asks for the state every two seconds, and shows it.

import "./style.css";

import { find, make, say } from "../shared/dom";
import { DetailsView } from "./details";
import { type Choices, PanelView } from "./panels";
import type { Details, Group, State } from "./state";
import { Table } from "./table";
import { clock, counts, left, STATES } from "./text";

const PAUSE = 2000; // ms between two questions
const SOON = 100; // ms, while there is more to be read

const page = {
  main: find("main", HTMLElement),
  title: find("title", HTMLElement),
  summary: find("summary", HTMLElement),
  problem: find("problem", HTMLElement),
  groups: find("groups", HTMLElement),
  choices: find("choices", HTMLElement),
  panels: find("panels", HTMLElement),
};
const choices: Choices = { quantity: "performance", axis: "evaluations" };
const views = new Map<string, PanelView>();
const table = new Table((label) => void show(label));
const details = new DetailsView(() => void show(null));
let state: State | null = null;
let tag = "";
let selected: string | null = null;
let drawn = ""; // what the details that are shown were made of

Object.assign(window, { conevo: { state: () => state, show } }); // for tests and consoles

/** Show the details of a run, or of none. */
async function show(label: string | null): Promise<void> {
  const other = label !== selected;
  selected = label;
  const hash = label === null ? "" : `#${encodeURIComponent(label)}`;
  if (location.hash !== hash) history.pushState(null, "", hash || location.pathname);
  drawn = other ? "" : drawn;
  await drawDetails();
}

async function drawDetails(): Promise<void> {
  const run = state?.runs.find((one) => one.label === selected);
  page.main.classList.toggle("has-details", run !== undefined);
  table.select(run ? selected : null);
  if (!state || !run) {
    details.hide();
    drawn = "";
    return;
  }
  details.drawSummary(run, state);
  const key = JSON.stringify([run, state.castes]);
  if (key === drawn) return;
  const answer = await ask(`/run.json?label=${encodeURIComponent(run.label)}`);
  if (selected !== run.label || !answer.ok) return;
  details.drawGenerations((await answer.json()) as Details);
  drawn = key;
}

function ask(address: string, headers: Record<string, string> = {}): Promise<Response> {
  return fetch(address, { headers, cache: "no-store", signal: AbortSignal.timeout(30_000) });
}

/** Ask for the state; return whether more is to be read. */
async function look(): Promise<boolean> {
  const answer = await ask("/state.json", tag ? { "If-None-Match": tag } : {});
  if (answer.status !== 304) {
    if (!answer.ok) throw new Error((await answer.text()).trim());
    state = (await answer.json()) as State;
    tag = answer.headers.get("ETag") ?? "";
    draw(state);
  }
  if (state) {
    drawGroups(state); // the time left goes on while nothing changes
    table.draw(state);
  }
  await drawDetails();
  return (state?.reading ?? 0) > 0;
}

function draw(now: State): void {
  document.title = `${now.title} – conevo watch`;
  say(page.title, now.title);
  page.main.classList.toggle("single", now.runs.length === 1);
  if (selected === null && now.runs.length === 1 && !document.body.dataset.ready) {
    selected = now.runs[0]?.label ?? null;
  }
  const keys = now.panels.map((panel) => JSON.stringify([panel.group, panel.task, panel.preset, panel.variant]));
  for (const [key, view] of views) {
    if (keys.includes(key)) continue;
    view.root.remove();
    views.delete(key);
  }
  now.panels.forEach((panel, k) => {
    const key = keys[k] ?? "";
    let view = views.get(key);
    if (!view) {
      view = new PanelView((label) => void show(label));
      views.set(key, view);
    }
    if (page.panels.children[k] !== view.root) page.panels.insertBefore(view.root, page.panels.children[k] ?? null);
    view.draw(now, panel, choices);
  });
}

function drawGroups(now: State): void {
  const total: Record<string, number> = {};
  for (const run of now.runs) total[run.status] = (total[run.status] ?? 0) + 1;
  const ends = now.groups.map((group) => group.ends_at).filter((end) => end !== null);
  const end = ends.length ? Math.max(...ends) : null;
  const eta = end === null ? "" : `, ${left(end)} (until ${clock(end)})`;
  const reading = now.reading ? `, reading ${now.reading} more` : "";
  say(page.summary, `${now.runs.length} ${now.runs.length === 1 ? "run" : "runs"}: ${counts(total)}${eta}${reading}`);
  page.groups.replaceChildren(...now.groups.map((group) => groupLine(group, now.groups.length)));
}

function groupLine(group: Group, n: number): HTMLElement {
  const size = Object.values(group.counts).reduce((sum, k) => sum + k, 0);
  const bar = make("span", { class: "stack", title: counts(group.counts) });
  for (const status of STATES) {
    const part = make("i", { class: status });
    part.style.width = `${size ? (100 * (group.counts[status] ?? 0)) / size : 0}%`;
    bar.append(part);
  }
  const eta = group.ends_at === null ? "" : `, ${left(group.ends_at)}`;
  const isLeft = group.kind === "campaign" && !group.running && (group.counts.finished ?? 0) < size;
  const whose = group.counts.running ? " (running without a coordinator)" : " (not running)";
  const line = make("div", { class: "group" });
  if (n > 1 || group.title !== group.name) line.append(make("b", { title: group.path }, group.title));
  line.append(bar, make("span", {}, `${counts(group.counts)}${eta}${isLeft ? whose : ""}`));
  if (group.problem) line.append(make("span", { class: "alert" }, group.problem));
  return line;
}

/** Make the switches over the charts. */
function makeChoices(): void {
  const add = <K extends keyof Choices>(key: K, values: [Choices[K], string][]): void => {
    const set = make("fieldset", { class: "switch" });
    for (const [value, text] of values) {
      const input = make("input", { type: "radio", name: key, value, checked: choices[key] === value });
      input.addEventListener("change", () => {
        choices[key] = value;
        if (state) draw(state);
      });
      set.append(make("label", {}, input, text));
    }
    page.choices.append(set);
  };
  add("quantity", [
    ["performance", "task performance"],
    ["fitness", "fitness"],
  ]);
  add("axis", [
    ["evaluations", "over team evaluations"],
    ["generation", "over generations"],
  ]);
  page.choices.append(
    make(
      "span",
      { class: "faint" },
      "Thick: median of the runs with the same method and settings, up to the point that at least half of those begun have reached. Thin: each run; point at one for its name, click for its details.",
    ),
  );
}

async function follow(): Promise<void> {
  let pause = PAUSE;
  try {
    pause = (await look()) ? SOON : PAUSE;
    page.problem.hidden = true;
  } catch (error) {
    const text = error instanceof Error ? error.message : String(error);
    say(page.problem, `The server cannot be reached (${text}). Is conevo watch still running? Trying again.`);
    page.problem.hidden = false;
  }
  if (state) document.body.dataset.ready = "yes";
  setTimeout(() => void follow(), pause);
}

function fromHash(): void {
  let label = "";
  try {
    label = decodeURIComponent(location.hash.slice(1));
  } catch {
    // no label of ours
  }
  selected = label || null;
  drawn = "";
  void drawDetails();
}

makeChoices();
addEventListener("popstate", fromHash);
fromHash();
void follow();
