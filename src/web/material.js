// material.js - how terrain is painted: relief, error, plain; and its edges.
//
// A vertex goes from one position to another (t from 0 to 1): a geomorph. Shading is that of a map, by light from the
// north-west at every place, in the axes east, north and up of the normals. Depth is logarithmic: a metre in front of the
// eye and a ridge 100 km away are told apart with the same care, and no plane near or far needs choosing.

import {DoubleSide, GLSL3, ShaderMaterial, Vector2} from 'three';
import {rampTexture} from './palette.js';
import {ERROR, LAND, SEA} from './ramps.js';

export const COLOURINGS = ['relief', 'error', 'plain'];

const VERTEX = /* glsl */ `
in vec3 from;
in float height;
in float heightFrom;
in float error;
uniform float t;
uniform float exaggeration;
centroid out vec3 shadingNormal;
centroid out float metres;
centroid out float metresOff;
centroid out float depth;
void main() {
    vec4 seen = modelViewMatrix * vec4(mix(from, position, t), 1.0);
    gl_Position = projectionMatrix * seen;
    depth = 1.0 + gl_Position.w;
    metres = mix(heightFrom, height, t);
    metresOff = error;
    shadingNormal = vec3(normal.xy * exaggeration, normal.z);
}`;

const FRAGMENT = /* glsl */ `
precision highp float;
uniform int colouring;
uniform vec2 heightRange;
uniform vec2 errorRange;
uniform float hazeDistance;
uniform vec3 hazeColour;
uniform float wires;
uniform float logDepthBufFC;
uniform sampler2D land;
uniform sampler2D sea;
uniform sampler2D errors;
centroid in vec3 shadingNormal;
centroid in float metres;
centroid in float metresOff;
centroid in float depth;
out vec4 colour;

vec3 tint() {
    if (colouring == 1) {
        float place = (log2(max(metresOff, 1e-6)) - errorRange.x) / (errorRange.y - errorRange.x);
        return texture(errors, vec2(place, 0.5)).rgb;
    }
    if (colouring == 2) return vec3(0.80, 0.80, 0.79);
    if (metres < 0.0 && heightRange.x < 0.0) return texture(sea, vec2(1.0 - metres / heightRange.x, 0.5)).rgb;
    float lowest = max(heightRange.x, 0.0);
    return texture(land, vec2((metres - lowest) / max(heightRange.y - lowest, 1e-3), 0.5)).rgb;
}

void main() {
    vec3 n = normalize(shadingNormal);
    float sun = max(dot(n, normalize(vec3(-1.0, 1.0, 1.1))), 0.0);
    float sky = 0.5 + 0.5 * n.z;
    float west = max(dot(n, normalize(vec3(-1.0, -0.6, 0.6))), 0.0);
    float shade = 0.24 + 0.26 * sky + 0.54 * sun + 0.16 * west;
    // Errors keep their lightness, by which they are read.
    if (colouring == 1) shade = 0.62 + 0.44 * shade;
    vec3 lit = tint() * min(shade * 1.06, 1.25);
    if (!gl_FrontFacing) lit = vec3(dot(lit, vec3(0.1)));
    if (colouring != 1) lit = mix(lit, hazeColour, 0.55 * (1.0 - exp(-depth / hazeDistance)));
    colour = vec4(lit, 1.0);
    float d = log2(depth) * logDepthBufFC * 0.5;
    gl_FragDepth = d + wires * fwidth(d);
}`;

// Edges are taken to be a thousandth nearer than they are, so that the surface that they lie on does not hide them.
const EDGE_FRAGMENT = /* glsl */ `
precision highp float;
uniform vec4 edgeColour;
uniform float logDepthBufFC;
centroid in float depth;
out vec4 colour;
void main() {
    colour = edgeColour;
    gl_FragDepth = log2(depth * 0.999) * logDepthBufFC * 0.5;
}`;

/** The materials of surface and edges, which share their uniforms. */
export function createMaterials() {
    const uniforms = {
        t: {value: 1},
        exaggeration: {value: 1},
        colouring: {value: 0},
        heightRange: {value: new Vector2(0, 1)},
        errorRange: {value: new Vector2(0, 1)}, // log2 of metres
        hazeDistance: {value: 1e9},
        hazeColour: {value: [1, 1, 1]},
        wires: {value: 0},
        edgeColour: {value: [0.05, 0.07, 0.1, 0.38]},
        land: {value: rampTexture(LAND)},
        sea: {value: rampTexture(SEA)},
        errors: {value: rampTexture(ERROR)},
    };
    const common = {glslVersion: GLSL3, uniforms, vertexShader: VERTEX};
    return {
        uniforms,
        surface: new ShaderMaterial({...common, fragmentShader: FRAGMENT, side: DoubleSide}),
        edges: new ShaderMaterial({...common, fragmentShader: EDGE_FRAGMENT, transparent: true, depthWrite: false}),
    };
}
