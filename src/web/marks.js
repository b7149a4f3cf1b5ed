// marks.js - what is marked on the terrain: pins with their heights, and the line of a profile.

import {LineSegments2} from 'three/addons/lines/LineSegments2.js';
import {LineSegmentsGeometry} from 'three/addons/lines/LineSegmentsGeometry.js';
import {LineMaterial} from 'three/addons/lines/LineMaterial.js';
import {subtract} from './scene.js';

const NAMESPACE = 'http://www.w3.org/2000/svg';
const STEM = 22; // CSS pixels from the place to its label
const FOOT = 4; // CSS pixels of a pin that the ground may hide

function pinNode(label) {
    const node = document.createElementNS(NAMESPACE, 'g');
    if (label) {
        const stem = document.createElementNS(NAMESPACE, 'line'), text = document.createElementNS(NAMESPACE, 'text');
        stem.setAttribute('y2', -STEM);
        text.setAttribute('y', -STEM - 5);
        text.textContent = label;
        node.append(stem, text);
    }
    const dot = document.createElementNS(NAMESPACE, 'circle');
    dot.setAttribute('r', 5);
    node.append(dot);
    return node;
}

export class Marks {
    /** @param overlay the SVG over the picture @param scene of three.js */
    constructor(overlay, scene) {
        Object.assign(this, {overlay, pins: new Map(), lines: []});
        // Twice: where the mesh hides it, faintly.
        for (const [opacity, depthTest] of [[0.3, false], [1, true]]) {
            const line = new LineSegments2(new LineSegmentsGeometry(), new LineMaterial({linewidth: 3, transparent: true, opacity, depthTest}));
            line.frustumCulled = false;
            line.visible = false;
            line.renderOrder = 2;
            scene.add(line);
            this.lines.push(line);
        }
        this.restyle();
    }

    /** Takes the accent colour of the page, which may have gone from light to dark. */
    restyle() {
        const accent = getComputedStyle(document.documentElement).getPropertyValue('--accent').trim();
        for (const {material} of this.lines) material.color.set(accent);
    }

    /** Puts the pin of a name at a point of the scene; a null point takes it away. */
    pin(name, point, label = '') {
        this.pins.get(name)?.node.remove();
        this.pins.delete(name);
        if (!point) return;
        const node = pinNode(label);
        this.overlay.append(node);
        this.pins.set(name, {point, node});
    }

    /** @param runs of two or more points of the scene: a void interrupts the line; none: no line */
    line(runs) {
        const origin = runs[0]?.[0], place = point => subtract(point, origin);
        const positions = runs.flatMap(run => run.slice(1).flatMap((point, i) => [...place(run[i]), ...place(point)]));
        for (const line of this.lines) {
            line.visible = runs.length > 0;
            if (!line.visible) continue;
            line.geometry.dispose();
            line.geometry = new LineSegmentsGeometry();
            line.geometry.setPositions(positions);
            line.position.set(...origin);
        }
    }

    clear() {
        for (const name of [...this.pins.keys()]) this.pin(name, null);
        this.line([]);
    }

    /**
     * Puts everything where the camera sees it.
     * @param hides(x, y, depth) is something in front of that depth, at a place of the picture?
     */
    place(camera, width, height, hides) {
        for (const {point, node} of this.pins.values()) {
            const at = camera.project(point);
            node.style.display = at ? '' : 'none';
            if (!at) continue;
            node.setAttribute('transform', `translate(${(at.x + 1) / 2 * width} ${(1 - at.y) / 2 * height})`);
            // Looked for a little above its foot: the mesh there may be as much higher than the terrain.
            node.classList.toggle('behind', hides(at.x, at.y + 2 * FOOT / height, at.depth));
        }
    }
}
