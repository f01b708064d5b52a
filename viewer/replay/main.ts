// The replay of one epoch: reads what the page carries, and shows it.

import "./page.css";
import "./team.css";
import "./cards.css";
import "./narrow.css";
import { find, make } from "../shared/dom";
import { Clock } from "./clock";
import { Controls } from "./controls";
import { Damaged, inflate } from "./data";
import { makeInterface } from "./interface";
import { listenToKeys } from "./keys";
import { readStages } from "./stage";
import { Store } from "./state";
import { Team } from "./team";
import { Tooltip } from "./tooltip";

declare global {
  interface Window {
    conevo: { ready: Promise<void> } & Partial<ReturnType<typeof makeInterface>>;
  }
}

/** Show the data of the page. Throws Damaged if they cannot be shown. */
async function show(): Promise<void> {
  const texts = ["about", "data"].map((id) => document.getElementById(id)?.textContent);
  const [about, data] = texts;
  if (!about || data === undefined || data === null) throw new Damaged("it carries no data");
  const store = new Store(readStages(about, await inflate(data)));
  const clock = new Clock(store);
  const tooltip = new Tooltip();
  const teams = store.stages.map((stage, k) => new Team(stage, k, store, tooltip));

  const titles = new Set(store.stages.map((stage) => stage.title));
  document.title = `${[...titles].join(" and ")} - conevo`;
  document.body.classList.add(teams.length > 1 ? "two" : "one");
  find("teams", HTMLElement).append(...teams.map((team) => team.element));
  new Controls(store, clock);
  const times = () => teams.flatMap((team) => team.events.times).sort((a, b) => a - b);
  listenToKeys(store, clock, times);
  find("app", HTMLElement).hidden = false;
  for (const team of teams) team.watch();
  store.tell();
  Object.assign(window.conevo, makeInterface(store, clock, teams));
  document.body.dataset["ready"] = "yes";
}

/** Say in one line why nothing is shown. */
function complain(error: unknown): void {
  const reason = error instanceof Damaged ? error.message : "its data do not fit each other";
  find("app", HTMLElement).hidden = true;
  document.body.append(make("p", { role: "alert" }, `This replay cannot be shown: ${reason}.`));
  document.body.dataset["ready"] = "error";
}

window.conevo = { ready: show().catch(complain) };
