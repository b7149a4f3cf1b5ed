// palette.js - colours of heights and errors: for the graphics card as textures, for legends as CSS.

import {ClampToEdgeWrapping, DataTexture, LinearFilter, NoColorSpace, RGBAFormat} from 'three';

// Land from lowland to summit, sea from the deep to the shore: muted, and even in lightness, so that the shading is read.
export const LAND = ['#7c9a78', '#98ad83', '#b6be92', '#cfc7a0', '#cdb48f', '#b99b80', '#ab9186', '#b9aca8', '#d9d4d2', '#f6f5f4'];
export const SEA = ['#27405f', '#34587d', '#477499', '#6795b2', '#94b7c8', '#bcd3d8'];
// Cividis (Nunez, Anderton and Renslow 2018): even to the eye, and the same to eyes that take red for green.
export const ERROR = ['#00224e', '#123570', '#3b496c', '#575d6d', '#707173', '#8a8678', '#a59c74', '#c3b369', '#e1cc55', '#fee838'];

const WIDTH = 256;
const channels = hex => [1, 3, 5].map(at => parseInt(hex.slice(at, at + 2), 16));

function colourAt(stops, place) {
    const at = place * (stops.length - 1), i = Math.min(Math.floor(at), stops.length - 2);
    const low = channels(stops[i]), high = channels(stops[i + 1]);
    return low.map((value, channel) => Math.round(value + (high[channel] - value) * (at - i)));
}

/** A texture one pixel high. */
export function rampTexture(stops) {
    const data = new Uint8Array(4 * WIDTH);
    for (let i = 0; i < WIDTH; i++) data.set([...colourAt(stops, i / (WIDTH - 1)), 255], 4 * i);
    const texture = new DataTexture(data, WIDTH, 1, RGBAFormat);
    texture.colorSpace = NoColorSpace;
    texture.minFilter = texture.magFilter = LinearFilter;
    texture.wrapS = texture.wrapT = ClampToEdgeWrapping;
    texture.needsUpdate = true;
    return texture;
}

/** The same from left to right. */
export const rampCss = stops => `linear-gradient(to right, ${stops.join(', ')})`;
