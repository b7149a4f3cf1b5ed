// flight.js - a flight round the highest ground: a circle above everything, looking at the summit.

const ROUND = 90; // seconds
const GRID = 24; // places a side where the summit is looked for
const STEEP = Math.tan(22 * Math.PI / 180); // height above the summit by distance
const EARTH = 6371000; // metres
const METRES = EARTH * Math.PI / 180; // of a degree of latitude

/** Places over the terrain, half a step from its borders. */
function gridOf([west, south, east, north]) {
    const places = [];
    for (let i = 0; i < GRID; i++)
        for (let j = 0; j < GRID; j++) places.push([west + (east - west) * (i + 0.5) / GRID, south + (north - south) * (j + 0.5) / GRID]);
    return places;
}

export class Flight {
    /** Round the highest of the places that are looked at: as many as a few tiles show. */
    static async round(globe, bbox, heights) {
        const places = gridOf(bbox), level = Math.max(0, globe.sampled.finest - 3);
        const found = await globe.sample(places, level);
        let top = -1;
        found.forEach((height, i) => { if (height !== null && (top < 0 || height > found[top])) top = i; });
        const centre = top < 0 ? globe.centre : places[top];
        return new Flight(globe, bbox, centre, top < 0 ? heights[1] : found[top]);
    }

    constructor(globe, [west, south, east, north], centre, height) {
        const across = (east - west) * METRES * Math.cos(centre[1] * Math.PI / 180), up = (north - south) * METRES;
        Object.assign(this, {globe, centre, height, radius: Math.min(Math.max(0.28 * Math.min(across, up), 300), 2.5e6), at: 0, isOn: false});
    }

    /** The camera at a share of the round, 0 .. 1: that of globe.js. */
    cameraAt(share, exaggeration) {
        const angle = 2 * Math.PI * share, {centre: [longitude, latitude], radius} = this;
        const north = radius * Math.cos(angle) / METRES, east = radius * Math.sin(angle) / METRES / Math.max(Math.cos(latitude * Math.PI / 180), 0.05);
        const top = Math.max(this.height, 0) * exaggeration, height = top + radius * STEEP, turn = radius / EARTH;
        // Down to the summit, beyond what the Earth is round.
        const pitch = -Math.atan2(EARTH + height - (EARTH + top) * Math.cos(turn), (EARTH + top) * Math.sin(turn)) * 180 / Math.PI;
        return {
            longitude: (longitude + east + 540) % 360 - 180, latitude: Math.min(Math.max(latitude + north, -89.9), 89.9), height,
            heading: (share * 360 + 180) % 360, pitch,
        };
    }

    show(exaggeration) {
        this.globe.camera = this.cameraAt(this.at, exaggeration);
    }

    /** A frame at a time in milliseconds. */
    step(now, exaggeration) {
        const seconds = this.last === undefined ? 0 : Math.min((now - this.last) / 1000, 0.25);
        this.last = this.isOn ? now : undefined;
        if (!this.isOn) return;
        this.at = (this.at + seconds / ROUND) % 1;
        this.show(exaggeration);
    }
}
