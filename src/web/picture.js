// picture.js - the canvas: three.js, its size, its frames, and what happens when the graphics card goes away.

import {PerspectiveCamera, Scene, WebGLRenderer} from 'three';
import {length, subtract} from './scene.js';

const MOST_PIXELS_A_POINT = 2; // of a phone's three nobody sees the third

export class Picture {
    /**
     * Throws when there is no WebGL.
     * @param canvas
     * @param keep may the picture be read after it was shown?
     * @param lost called with true when the context is lost, with false when it is back
     */
    constructor(canvas, keep, lost) {
        this.canvas = canvas;
        this.renderer = new WebGLRenderer({
            canvas, antialias: true, alpha: true, logarithmicDepthBuffer: true, preserveDrawingBuffer: keep,
        });
        this.renderer.setClearColor(0, 0);
        this.scene = new Scene();
        this.eye = new PerspectiveCamera();
        this.eye.matrixAutoUpdate = false;
        canvas.addEventListener('webglcontextlost', event => {
            event.preventDefault();
            this.forget();
            lost(true);
        });
        canvas.addEventListener('webglcontextrestored', () => lost(false));
    }

    /**
     * Gives back what of the scene is on the graphics card; the next frame puts it there again. While the context is lost,
     * this does nothing but make three.js forget; once it is back, what was of the old one could not be deleted any more.
     */
    forget() {
        this.scene.traverse(({geometry, material}) => {
            geometry?.dispose();
            material?.dispose();
            for (const {value} of Object.values(material?.uniforms || {})) value?.dispose?.();
        });
    }

    /** Takes the size of the canvas on the page; is it another one? Width and height are those of the drawing buffer. */
    fit(camera) {
        const {clientWidth, clientHeight} = this.canvas;
        const ratio = Math.min(window.devicePixelRatio, MOST_PIXELS_A_POINT);
        const width = Math.max(1, Math.floor(clientWidth * ratio)), height = Math.max(1, Math.floor(clientHeight * ratio));
        if (width === camera.width && height === camera.height) return false;
        this.renderer.setPixelRatio(ratio);
        this.renderer.setSize(clientWidth, clientHeight, false);
        camera.width = width;
        camera.height = height;
        return true;
    }

    /**
     * @param camera of camera.js
     * @param clearance metres between eye and ground
     * @param far a point, further than which nothing is drawn
     */
    draw(camera, clearance, far) {
        const {right, up, forward} = camera.basis(), [x, y, z] = camera.eye, {eye} = this;
        eye.matrix.set(
            right[0], up[0], -forward[0], x, right[1], up[1], -forward[1], y, right[2], up[2], -forward[2], z, 0, 0, 0, 1);
        eye.matrixWorldNeedsUpdate = true;
        eye.fov = camera.fovy;
        eye.aspect = camera.width / camera.height;
        eye.near = Math.max(0.05, 0.02 * Math.min(clearance, 1e5));
        eye.far = 2 * length(subtract(far.centre, camera.eye)) + 2 * far.radius;
        eye.updateProjectionMatrix();
        this.renderer.render(this.scene, eye);
    }
}
