"use strict";
/* What the page says of its tools and keys. */

const Words = (() => {
  const TOOLS = [["move", "Move", "m"], ["disc", "Disc", "o"], ["wall", "Wall", "w"], ["cart", "Cart", "t"], ["erase", "Erase", "e"]];
  const HINTS = {
    move: "Drag an obstacle, as fast as a hand, or the ground; pinch or turn the wheel to zoom.",
    disc: "Click where a disc is to stand.", wall: "Drag from one end of a wall to the other.",
    cart: "Click where a cart is to stand; its corners are a convex polygon.", erase: "Click what is to go.",
  };

  const KEYS = [["space", "start and pause"], [".", "one step"], ["r", "reset: everything back to its start"], ["1 … 6", "let a method drive, or not"],
    ["m o w t e", "tools: move, disc, wall, cart, erase"], ["[ ]", "choose the obstacle before or after"],
    ["arrows", "on the scene: move what is chosen, else a cross; with shift five times as far"], ["Enter", "on the scene: what a click does, at the cross; twice for a wall"],
    ["Esc", "choose nothing"], ["Delete", "remove what is chosen"], ["+ − f", "zoom, and show everything"], ["p", "park here, or drive on"], ["l", "choose true obstacles or LiDAR"],
    ["c", "record from the start, or end the recording"], ["s", "save the recording, or the scene, as TOML"], ["g", "go to the scenes"], ["z", "the plane of twists: all, or the limits of this step"], ["d", "dark or light"], ["?", "these keys"]];

  return { TOOLS, HINTS, KEYS };
})();
