// Puts the page together: reads the library, follows the address, connects panes to their scenes.

import { mountScorecard } from "./claims/scorecard.js";
import { listenKeys } from "./keyboard.js";
import { mountAlgorithms } from "./library/algorithms.js";
import { mountLaunch } from "./library/launch.js";
import { mountMissions } from "./library/missions.js";
import { mountPreview } from "./library/preview.js";
import { part } from "./look/dom.js";
import { mountNotices } from "./notices.js";
import { mountSchedule } from "./pursuit/schedule.js";
import { mountRooms } from "./rooms.js";
import { mountRuns } from "./runs/runs.js";
import { mountSide } from "./side.js";
import { mountBroadcasts } from "./smoothing/broadcasts.js";
import { clock } from "./state/clock.js";
import { suspect } from "./state/connection.js";
import { pickAgain, readLibrary } from "./state/library.js";
import { mountLink } from "./state/link.js";
import { store } from "./state/store.js";
import { isTrial } from "./state/whatif.js";
import { mountStudies } from "./studies/studies.js";
import { mountTabs } from "./tabs.js";
import { mountExplorer } from "./tracking/explorer.js";
import { mountUpload } from "./upload/dialog.js";
import { SceneSession } from "./wire/scenes.js";
import { mountClaims } from "./workbench/claims.js";
import { mountHeadline } from "./workbench/headline.js";
import { MOST_PANES, hasWebGL, mountPanes } from "./workbench/panes.js";
import { mountPlots } from "./workbench/plots.js";
import { mountTable } from "./workbench/table.js";
import { mountTimeline } from "./workbench/timeline.js";
import { mountToolbar } from "./workbench/toolbar.js";
import { mountWhatIf } from "./whatif/panel.js";

mountRooms();
mountSide();
mountTabs();
mountNotices();
mountMissions();
mountAlgorithms();
mountLaunch();
mountWhatIf();
mountUpload();
mountPreview();
mountExplorer();
mountStudies();
mountHeadline();

const panes = mountPanes(listenKeys);
const session = new SceneSession({
  scenes: (addresses) => panes.place(addresses),
  error: (detail) => panes.fail(detail),
  link: (up) => (up ? store.set({ connected: true }) : suspect()),
});
mountToolbar(session);
mountTimeline();
mountSchedule();
mountPlots();
mountBroadcasts();
mountTable();
mountClaims();
mountRuns();
mountScorecard();
listenKeys(window);

store.watch(["run", "room"], ({ run, room }) => (part("workbench").hidden = run === null || room !== "workbench"));

let shown = null;
store.watch(["job"], ({ job }) => {
  if (!hasWebGL || (job?.id ?? null) === shown) return;
  shown = job?.id ?? null;
  if (job) session.show(job.id, job.algorithms.slice(0, MOST_PANES));
});
let picked = null;
store.watch(["job", "missions"], ({ job, missions }) => {
  if (!job || missions === null || job.id === picked) return;
  picked = job.id;
  if (!isTrial(job.id)) pickAgain(job);
});
clock.watch(() => {
  if (shown !== null && clock.end > clock.start && !clock.following) session.seek(clock.time);
});

mountLink();
await readLibrary();
