// All that fills the stage beside the form for a new run: the open run with its scenes, the other rooms, uploads, help.

import { mountScorecard } from "./claims/scorecard.js";
import { mountHelp } from "./help.js";
import { listenKeys } from "./keyboard.js";
import { part } from "./look/dom.js";
import { loadPlotly } from "./look/plotly.js";
import { mountSchedule } from "./pursuit/schedule.js";
import { mountRuns } from "./runs/runs.js";
import { mountListening } from "./slam/listening.js";
import { mountBroadcasts } from "./smoothing/broadcasts.js";
import { clock } from "./state/clock.js";
import { suspect } from "./state/connection.js";
import { pickAgain } from "./state/library.js";
import { mountLink } from "./state/link.js";
import { keepPanesInLink, paneNames, paneState } from "./state/panes.js";
import { startedByForm } from "./state/run.js";
import { store } from "./state/store.js";
import { isTrial } from "./state/whatif.js";
import { mountStudies } from "./studies/studies.js";
import { mountExplorer } from "./tracking/explorer.js";
import { mountUpload } from "./upload/dialog.js";
import { SceneSession } from "./wire/scenes.js";
import { mountClaims } from "./workbench/claims.js";
import { mountHeadline } from "./workbench/headline.js";
import { mountPanes } from "./workbench/panes.js";
import { mountPass } from "./workbench/pass.js";
import { mountPlots } from "./workbench/plots.js";
import { mountTable } from "./workbench/table.js";
import { mountTimeline } from "./workbench/timeline.js";
import { mountToolbar } from "./workbench/toolbar.js";
import { mountWhatIf } from "./whatif/panel.js";

/** Plots keep frames waiting no longer than this once they can be drawn. */
const PLOTS_MS = 1500;

/** Mounts it, and follows the address. */
export function mountStage() {
  mountWhatIf();
  mountUpload();
  mountExplorer();
  mountStudies();
  mountHeadline();
  mountPass();

  const panes = mountPanes(listenKeys);
  const session = new SceneSession({
    scenes: (addresses) => afterPlots(() => panes.place(addresses)),
    camera: (pose) => paneState.set({ camera: pose }),
    error: (detail) => panes.fail(detail),
    link: (up) => (up ? store.set({ connected: true }) : suspect()),
  });
  mountToolbar(session, panes);
  keepPanesInLink((pose) => session.look(pose));
  mountTimeline();
  mountListening();
  mountSchedule();
  mountPlots();
  mountBroadcasts();
  mountTable();
  mountClaims();
  mountRuns();
  mountScorecard();
  listenKeys(window);
  mountHelp();

  store.watch(["run", "room"], ({ run, room }) => (part("workbench").hidden = run === null || room !== "workbench"));

  let shown = null;
  const showScenes = () => {
    const { job, hidden } = store.state;
    const { layout } = paneState.state;
    const names = layout === "plan" ? [] : paneNames(job, layout, hidden);
    const wanted = names.length ? JSON.stringify([job.id, names]) : null;
    if (wanted === shown) return;
    shown = wanted;
    if (wanted === null) return;
    session.show(job.id, names);
    if (clock.end > clock.start && !clock.following) session.seek(clock.time);
  };
  store.watch(["job", "hidden"], showScenes);
  paneState.watch(["layout"], showScenes);
  let picked = null;
  // What a person says of the next run while one that was asked for comes stays.
  let before = null;
  store.watch(["run"], ({ asked, varied }) => (before = { asked, varied }));
  store.watch(["job", "missions"], ({ job, missions, asked, varied }) => {
    if (!job || missions === null || job.id === picked) return;
    picked = job.id;
    if (!startedByForm(job.id) && !isTrial(job.id) && asked === before.asked) pickAgain(job, saidSince(before.varied, varied));
  });
  clock.watch(() => {
    if (shown !== null && clock.end > clock.start && !clock.following) session.seek(clock.time);
  });

  mountLink();
}

/** What of a new run's variation was said since another one. */
function saidSince(before, varied) {
  const said = Object.fromEntries(["trials", "seed"].filter((key) => varied[key] !== before[key]).map((key) => [key, varied[key]]));
  const changes = Object.entries(varied.changes).filter(([key, value]) => value !== before.changes[key]);
  return { ...said, changes: Object.fromEntries(changes) };
}

let waiting = null;

/** Does the newest of such acts when the page has drawn its plots: frames that open keep it busy for a while. */
async function afterPlots(act) {
  waiting = act;
  await loadPlotly().catch(() => {});
  const go = () => waiting === act && act();
  if (window.requestIdleCallback) requestIdleCallback(go, { timeout: PLOTS_MS });
  else setTimeout(go);
}
