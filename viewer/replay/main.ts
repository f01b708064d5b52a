// The replay of one epoch: reads the data in the page, and shows them.

import "./page.css";
import "./team.css";
import "./cards.css";
import "./narrow.css";
import { find, make } from "../shared/dom";
import { Clock } from "./clock";
import { Controls } from "./controls";
import { inflate, readPlaybacks } from "./data";
import { makeInterface } from "./interface";
import { listenToKeys } from "./keys";
import { Store } from "./state";
import { Team } from "./team";
import { Tooltip } from "./tooltip";

declare global {
  interface Window {
    conevo: { ready: Promise<void> } & Partial<ReturnType<typeof makeInterface>>;
  }
}

/** Show the data of the page. */
async function show(): Promise<void> {
  const [about, data] = [find("about", HTMLElement), find("data", HTMLElement)];
  const store = new Store(readPlaybacks(about.textContent!, await inflate(data.textContent!)));
  const clock = new Clock(store);
  const tooltip = new Tooltip();
  const teams = store.playbacks.map((playback, k) => new Team(playback, k, store, tooltip));

  const titles = new Set(store.playbacks.map((playback) => playback.title));
  document.title = `${[...titles].join(" and ")} - conevo`;
  document.body.classList.add(teams.length > 1 ? "two" : "one");
  find("teams", HTMLElement).append(...teams.map((team) => team.element));
  new Controls(store, clock);
  const times = () => teams.flatMap((team) => team.events.times).sort((a, b) => a - b);
  listenToKeys(store, clock, times);
  find("app", HTMLElement).hidden = false;
  for (const team of teams) team.watch();
  store.notify();
  Object.assign(window.conevo, makeInterface(store, clock, teams));
  document.body.dataset["ready"] = "yes";
}

/** Show in one line that the data are missing or damaged: the file was cut or changed. */
function complain(): void {
  const text = "This replay cannot be shown: its data are missing or damaged.";
  find("app", HTMLElement).hidden = true;
  document.body.append(make("p", { role: "alert" }, text));
  document.body.dataset["ready"] = "error";
}

window.conevo = { ready: show().catch(complain) };
