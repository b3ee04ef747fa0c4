// Puts the page together: first what a new run is made from, while that is looked at all the rest.

import { mountAlgorithms } from "./library/algorithms.js";
import { mountLaunch } from "./library/launch.js";
import { mountMissions } from "./library/missions.js";
import { mountPreview } from "./library/preview.js";
import { mountNotices } from "./notices.js";
import { mountRooms } from "./rooms.js";
import { mountSide } from "./side.js";
import { readLibrary } from "./state/library.js";
import { mountTabs } from "./tabs.js";

mountRooms();
mountSide();
mountTabs();
mountNotices();
mountMissions();
mountAlgorithms();
mountLaunch();

// An address that asks for something is followed before anything is picked or drawn.
const asked = location.hash !== "";
const rest = import("./stage.js");
if (asked) (await rest).mountStage();
mountPreview();
readLibrary();
if (!asked) (await rest).mountStage();
