// The page: live if its server has a suite to watch, a playback if it has bags.

import {get} from "./server.js";

const mode = await get("mode").catch(() => ({playback: false}));
const {begin} = await import(mode.playback ? "./play.js" : "./live.js");
begin(mode);
