// ramps.js - colours of heights and errors, from low to high.

// Land from lowland to summit, sea from the deep to the shore: muted, and even in lightness, so that the shading is read.
export const LAND = ['#7c9a78', '#98ad83', '#b6be92', '#cfc7a0', '#cdb48f', '#b99b80', '#ab9186', '#b9aca8', '#d9d4d2', '#f6f5f4'];
export const SEA = ['#27405f', '#34587d', '#477499', '#6795b2', '#94b7c8', '#bcd3d8'];
// Cividis (Nunez, Anderton and Renslow 2018): even to the eye, and the same to eyes that take red for green.
export const ERROR = ['#00224e', '#123570', '#3b496c', '#575d6d', '#707173', '#8a8678', '#a59c74', '#c3b369', '#e1cc55', '#fee838'];

const channels = hex => [1, 3, 5].map(at => parseInt(hex.slice(at, at + 2), 16));

/** The colour [red, green, blue] of 0 .. 255 at a place of 0 .. 1. */
export function colourAt(stops, place) {
    const at = place * (stops.length - 1), i = Math.min(Math.floor(at), stops.length - 2);
    const low = channels(stops[i]), high = channels(stops[i + 1]);
    return low.map((value, channel) => Math.round(value + (high[channel] - value) * (at - i)));
}

/** The same for CSS, from left to right. */
export const rampCss = stops => `linear-gradient(to right, ${stops.join(', ')})`;
