// A goal is a drag: from where the object shall be, in the direction that it shall face. What is
// shorter than SHORTEST is a stray click and no goal. Pure functions of a drag that is never changed.

export const SHORTEST = 24;   // [CSS pixels]

// place: {x, y} [m]; pixel: {x, y} [CSS pixels]
export const begun = (place, pixel) => ({place, pixel, theta: 0, long: false});

export function moved(drag, place, pixel) {
  const long = Math.hypot(pixel.x - drag.pixel.x, pixel.y - drag.pixel.y) >= SHORTEST;
  const theta = Math.atan2(place.y - drag.place.y, place.x - drag.place.x);
  return {...drag, long, theta: long ? theta : drag.theta};
}

// What releasing the mouse asks for: a pose [m, m, rad], or null for nothing.
export const released = drag =>
  drag?.long ? {x: drag.place.x, y: drag.place.y, theta: drag.theta} : null;
