// space.mjs - cameras, rays and triangles as ALGORITHMS and ext/camera.c define them, written down once more for the tests.
//
// It shares nothing with src/web. Scene: metres; in degrees geocentric on WGS 84 (the tests' terrains in degrees are), else
// x, y and height of the CRS (whose unit the tests' terrains have in metres).

const RADIANS = Math.PI / 180, A = 6378137, E2 = 0.00669437999014131699614;

const dot = (p, q) => p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
const cross = (p, q) => [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
const minus = (p, q) => p.map((v, i) => v - q[i]);
const sum = (...terms) => [0, 1, 2].map(i => terms.reduce((s, [by, v]) => s + by * v[i], 0));

/** From a place [x, y, height] to a point of the scene. */
export function toPoint([x, y, z], degrees) {
    if (!degrees) return [x, y, z];
    const lon = x * RADIANS, lat = y * RADIANS, n = A / Math.sqrt(1 - E2 * Math.sin(lat) ** 2);
    return [(n + z) * Math.cos(lat) * Math.cos(lon), (n + z) * Math.cos(lat) * Math.sin(lon), (n * (1 - E2) + z) * Math.sin(lat)];
}

/** And back: the latitude by repetition until it stays. */
export function toPlace([x, y, z], degrees) {
    if (!degrees) return [x, y, z];
    const across = Math.hypot(x, y);
    let lat = Math.atan2(z, across * (1 - E2)), height = 0;
    for (let i = 0; i < 30; i++) {
        const n = A / Math.sqrt(1 - E2 * Math.sin(lat) ** 2);
        height = across / Math.cos(lat) - n;
        lat = Math.atan2(z, across * (1 - (E2 * n) / (n + height)));
    }
    return [Math.atan2(y, x) / RADIANS, lat / RADIANS, height];
}

/** Eye and unit vectors of a camera JSON with yaw and pitch. */
export function frameOf(camera, degrees) {
    const [lon, lat] = camera.eye.map(v => v * RADIANS);
    const east = degrees ? [-Math.sin(lon), Math.cos(lon), 0] : [1, 0, 0];
    const up = degrees ? [Math.cos(lat) * Math.cos(lon), Math.cos(lat) * Math.sin(lon), Math.sin(lat)] : [0, 0, 1];
    const north = cross(up, east), yaw = camera.yaw * RADIANS, pitch = camera.pitch * RADIANS;
    const forward = sum([Math.cos(pitch) * Math.sin(yaw), east], [Math.cos(pitch) * Math.cos(yaw), north], [Math.sin(pitch), up]);
    const right = sum([Math.cos(yaw), east], [-Math.sin(yaw), north]);
    return {eye: toPoint(camera.eye, degrees), forward, right, above: cross(right, forward)};
}

/** The direction in which a place of the picture is seen: pixels, x to the right and y down from its corner. */
export function rayThrough(camera, x, y, degrees) {
    const {forward, right, above} = frameOf(camera, degrees), half = Math.tan((camera.fovy / 2) * RADIANS);
    const across = (2 * x / camera.width - 1) * half * camera.width / camera.height, upward = (1 - 2 * y / camera.height) * half;
    return sum([1, forward], [across, right], [upward, above]);
}

/** Where a point is in the picture, in pixels; null behind the eye. */
export function seenAt(camera, point, degrees) {
    const {eye, forward, right, above} = frameOf(camera, degrees), from = minus(point, eye), depth = dot(from, forward);
    if (depth <= 0) return null;
    const scale = camera.height / 2 / Math.tan((camera.fovy / 2) * RADIANS) / depth;
    return [camera.width / 2 + scale * dot(from, right), camera.height / 2 - scale * dot(from, above)];
}

/** The vanishing point of the vertical, in pixels; null where it is too far away to matter. */
export function vanishingPoint({pitch, fovy, width, height}) {
    if (Math.abs(pitch) < 0.5) return null;
    const offset = height / 2 / Math.tan((fovy / 2) * (Math.PI / 180)) / Math.tan(Math.abs(pitch) * (Math.PI / 180));
    return [width / 2, height / 2 + (pitch < 0 ? offset : -offset)];
}

/**
 * The first triangle on a ray: {point, triangle, distance}, or null. Every triangle is asked; `triangles` holds three points each.
 * A ray passes a triangle when its edges turn around the ray in one sense, seen along it.
 */
export function firstHit(eye, ray, triangles) {
    let best = null;
    triangles.forEach((corners, triangle) => {
        const [a, b, c] = corners.map(corner => minus(corner, eye));
        const [u, v, w] = [dot(ray, cross(b, c)), dot(ray, cross(c, a)), dot(ray, cross(a, b))], total = u + v + w;
        if (total === 0 || Math.min(u / total, v / total, w / total) < 0) return;
        const local = sum([u / total, a], [v / total, b], [w / total, c]), distance = dot(local, ray) / dot(ray, ray);
        if (distance > 0 && (!best || distance < best.distance)) best = {point: sum([1, eye], [1, local]), triangle, distance};
    });
    return best;
}
