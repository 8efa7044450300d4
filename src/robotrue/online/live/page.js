// The live page on its own.

import { start } from "./live.js";

start();
