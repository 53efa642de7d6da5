// A goal is a drag: from the goal position in the direction that the object should face. A drag
// shorter than SHORTEST is a stray click and no goal. Pure functions of an immutable drag.

export const SHORTEST = 24;   // [CSS pixels]

// place: {x, y} [m]; pixel: {x, y} [CSS pixels]
export const begun = (place, pixel) => ({place, pixel, theta: 0, long: false});

export function moved(drag, place, pixel) {
  const long = Math.hypot(pixel.x - drag.pixel.x, pixel.y - drag.pixel.y) >= SHORTEST;
  const theta = Math.atan2(place.y - drag.place.y, place.x - drag.place.x);
  return {...drag, long, theta: long ? theta : drag.theta};
}

// The goal when the mouse is released: a pose [m, m, rad], or null.
export const released = drag =>
  drag?.long ? {x: drag.place.x, y: drag.place.y, theta: drag.theta} : null;
