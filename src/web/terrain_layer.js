// terrain_layer.js - the terrain in the picture: one mesh, and for the time of a geomorph the union of two.
//
// A *stage* is {geometry, morph}: a geometry of geometry.js, and the union that leads to it from the one before, or null.

import {BufferAttribute, BufferGeometry, LineSegments, Mesh} from 'three';
import {createMaterials} from './material.js';

export const MORPH_MILLISECONDS = 300;

const ease = t => t * t * (3 - 2 * t);

export class TerrainLayer {
    constructor(scene) {
        const {uniforms, surface, edges} = createMaterials();
        this.uniforms = uniforms;
        this.surface = new Mesh(new BufferGeometry(), surface);
        this.edges = new LineSegments(new BufferGeometry(), edges);
        this.edges.renderOrder = 1;
        for (const object of [this.surface, this.edges]) {
            object.frustumCulled = false;
            object.visible = false;
            scene.add(object);
        }
        this.stage = null;
        this.morphStart = 0;
    }

    /** Is a geomorph under way? */
    get isMoving() {
        return this.morphStart > 0;
    }

    /** Begins to show a stage at the time `now` (milliseconds). */
    show(stage, now) {
        this.stage = stage;
        this.morphStart = stage.morph ? now : 0;
        this.uniforms.t.value = stage.morph ? 0 : 1;
        this.use(stage.morph || stage.geometry);
    }

    /** Goes on to the time `now`. */
    advance(now) {
        if (!this.isMoving) return;
        const t = (now - this.morphStart) / MORPH_MILLISECONDS;
        if (t < 1) {
            this.uniforms.t.value = ease(t);
        } else {
            this.morphStart = 0;
            this.uniforms.t.value = 1;
            this.use(this.stage.geometry);
        }
    }

    clear() {
        this.stage = null;
        this.morphStart = 0;
        this.surface.visible = this.edges.visible = false;
    }

    use({origin, positions, positionsFrom, heights, heightsFrom, normals, errors, triangles, edges}) {
        const position = new BufferAttribute(positions, 3), height = new BufferAttribute(heights, 1);
        const attributes = {
            position,
            from: positionsFrom ? new BufferAttribute(positionsFrom, 3) : position,
            height,
            heightFrom: heightsFrom ? new BufferAttribute(heightsFrom, 1) : height,
            normal: new BufferAttribute(normals, 4, true),
            error: errors ? new BufferAttribute(errors, 1) : height,
        };
        this.replace(this.surface, attributes, triangles, origin);
        this.edges.visible = Boolean(edges);
        if (edges) this.replace(this.edges, attributes, edges, origin);
        this.uniforms.wires.value = edges ? 1 : 0;
    }

    replace(object, attributes, index, origin) {
        object.geometry.dispose();
        object.geometry = new BufferGeometry();
        for (const [name, attribute] of Object.entries(attributes)) object.geometry.setAttribute(name, attribute);
        object.geometry.setIndex(new BufferAttribute(index, 1));
        object.position.set(...origin);
        object.visible = true;
    }
}
