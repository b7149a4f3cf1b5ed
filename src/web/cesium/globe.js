// globe.js - Cesium's scene with a terrain of ours, as quantized-mesh on its globe or as 3D Tiles, and nothing from anywhere else.
//
// Cesium comes as its engine alone (Scene and Globe, not its widgets), so that the page is a fourth of what it could be.
// Nothing is fetched but the terrain's tiles: the sky is computed, there is no imagery, and the sun's place, for which
// Cesium would ask for tables, is not needed: light comes from the north-west over the terrain, as on maps. Pictures are
// drawn when something has changed, not sixty times a second.

import {
    Cartesian3, Cartographic, CesiumTerrainProvider, Color, Credit, CreditDisplay, DirectionalLight, EllipsoidPrimitive, Globe, Iau2006XysData, Material,
    Matrix4, Scene, SkyAtmosphere, TaskProcessor, Transforms, buildModuleUrl, sampleTerrain, sampleTerrainMostDetailed,
} from '@cesium/engine';
import {LAND, SEA, colourAt} from '../ramps.js';
import {askLayer, tilesPath} from '../service.js';
import {TilesetSurface} from './tileset.js';

const LIGHT = [-1, 1, 1.1]; // where it comes from: east, north, up
const SHADING = [0.85, 0.28]; // of the light, and without it
const PIXELS = 2; // that a tile may be off
const SHADES = 1024; // of the ramp of heights
const SEA_BED = 400; // metres below the ellipsoid, or the terrain: where the globe is that has no terrain

/** Cesium's folder, without the folder: rqt serve has all files beside each other. */
function settle() {
    buildModuleUrl.setBaseUrl(new URL('.', document.baseURI).href);
    TaskProcessor._workerModulePrefix = '';
    Transforms.iau2006XysData = new Iau2006XysData({totalSamples: 0}); // no tables
    CreditDisplay.cesiumCredit = new Credit('<a href="https://cesium.com/platform/cesiumjs/" target="_blank" rel="noopener">CesiumJS</a>', true);
}

/** Colours of heights: of the sea below 0, of the land above. */
function ramp([lowest, highest]) {
    const canvas = Object.assign(document.createElement('canvas'), {width: SHADES, height: 1});
    const context = canvas.getContext('2d'), picture = context.createImageData(SHADES, 1), shore = Math.max(lowest, 0);
    for (let i = 0; i < SHADES; i++) {
        const height = lowest + (highest - lowest) * i / (SHADES - 1);
        const colour = height < 0 ? colourAt(SEA, 1 - height / lowest) : colourAt(LAND, (height - shore) / Math.max(highest - shore, 1e-3));
        picture.data.set([...colour, 255], 4 * i);
    }
    context.putImageData(picture, 0, 0);
    return canvas;
}

/** Heights by colour, with lines of equal height over them where `contours` says so. */
function paint(heights, spacing) {
    return new Material({
        translucent: false,
        fabric: {
            type: 'Heights',
            materials: {
                heights: {type: 'ElevationRamp', uniforms: {image: ramp(heights), minimumHeight: heights[0], maximumHeight: heights[1]}},
                lines: {type: 'ElevationContour', uniforms: {color: new Color(0.2, 0.15, 0.1, 0.45), spacing, width: 1}},
            },
            uniforms: {contours: 0},
            components: {diffuse: 'mix(heights.diffuse, lines.diffuse, contours * lines.alpha)', alpha: '1.0'},
        },
    });
}

/** A round number of metres of which some twenty make the terrain's relief. */
function spacingOf([lowest, highest]) {
    const wanted = Math.max(highest - lowest, 1) / 20, power = 10 ** Math.floor(Math.log10(wanted));
    return power * [1, 2, 5, 10].find(step => step * power >= wanted);
}

/**
 * {finest, errors}: how far the tiles of each level may be from the samples, metres. Of all but the last that is what clients take
 * them to be off; the last is as fine as the terrain, but for what rounding moves, which is less than in the one before.
 */
function levelsOf({geometricErrors: errors, eps, maxzoom: finest}) {
    if (finest > 0) errors[finest] = Math.min(errors[finest], eps[finest] + errors[finest - 1] - eps[finest - 1]);
    return {errors, finest};
}

/** Terrain as quantized-mesh, on Cesium's globe. tileset.js has the same doors. */
class GlobeSurface {
    constructor(provider, levels, {heights, spacing}) {
        Object.assign(this, {provider, levels, heights, spacing});
    }

    addTo(scene, complain) {
        this.globe = scene.globe;
        this.scene = scene;
        scene.terrainProvider = this.provider;
        this.globe.material = paint(this.heights, this.spacing);
        this.provider.errorEvent.addEventListener(({message}) => complain(message));
    }

    set isShown(is) {
        this.globe.show = is;
    }

    set contours(are) {
        this.globe.material.uniforms.contours = are ? 1 : 0;
    }

    /** Cesium has no public door to this: its inspector goes by the same. */
    set wires(are) {
        this.globe._surface.tileProvider._debug.wireframe = are;
    }

    get shown() {
        return this.globe._surface._tilesToRender.map(({level}) => Math.min(level, this.levels.finest));
    }

    get isLoaded() {
        return this.globe.tilesLoaded;
    }

    pick(at) {
        const ray = this.scene.camera.getPickRay(at);
        return ray && this.globe.pick(ray, this.scene);
    }
}

export class TerrainGlobe {
    /**
     * @param stage {canvas, credits, lightbox}: elements
     * @param terrain {id, bbox, terrain: {min_z, max_z}} as the service tells
     * @param kind of tiles: "quantized-mesh", "3d-tiles"
     */
    static async create(stage, terrain, kind) {
        settle();
        const {min_z, max_z} = terrain.terrain, heights = [min_z ?? 0, Math.max(max_z ?? 0, (min_z ?? 0) + 1)];
        const style = {heights, spacing: spacingOf(heights), ramp: ramp(heights), light: SHADING, pixels: PIXELS};
        const levels = levelsOf(await askLayer(terrain.id));
        const provider = await CesiumTerrainProvider.fromUrl(tilesPath(terrain.id, 'quantized-mesh'), {requestVertexNormals: true});
        const surface = kind === '3d-tiles' ? await TilesetSurface.create(terrain, style) : new GlobeSurface(provider, levels, style);
        return new TerrainGlobe(stage, terrain, surface, {provider, finest: levels.finest}, heights);
    }

    /** sampled: quantized-mesh, whichever kind is shown: heights are read from it. */
    constructor({canvas, credits, lightbox}, {bbox: [west, south, east, north]}, surface, sampled, heights) {
        Object.assign(this, {canvas, surface, sampled, levels: surface.levels, heights, centre: [(west + east) / 2, (south + north) / 2]});
        const scene = new Scene({
            canvas, creditContainer: credits, creditViewport: lightbox, scene3DOnly: true, requestRenderMode: true, maximumRenderTimeChange: Infinity,
            orderIndependentTranslucency: false, msaaSamples: 4,
        });
        const globe = new Globe();
        scene.globe = globe;
        scene.camera.constrainedAxis = Cartesian3.UNIT_Z;
        scene.skyAtmosphere = new SkyAtmosphere();
        scene.backgroundColor = Color.fromCssColorString('#0b1016');
        const frame = Transforms.eastNorthUpToFixedFrame(Cartesian3.fromDegrees(...this.centre));
        const from = Matrix4.multiplyByPointAsVector(frame, new Cartesian3(...LIGHT), new Cartesian3());
        scene.light = new DirectionalLight({direction: Cartesian3.negate(Cartesian3.normalize(from, from), from), intensity: 1.6});
        Object.assign(globe, {
            enableLighting: true, dynamicAtmosphereLighting: false, lambertDiffuseMultiplier: SHADING[0], vertexShadowDarkness: SHADING[1], showWaterEffect: false,
            depthTestAgainstTerrain: true, tileCacheSize: 400, maximumScreenSpaceError: PIXELS, baseColor: Color.WHITE, backFaceCulling: false,
        });
        // Where there is no terrain, a globe nonetheless.
        const below = Math.min(0, heights[0]) - SEA_BED, {x, y, z} = globe.ellipsoid.radii;
        scene.primitives.add(new EllipsoidPrimitive({
            radii: new Cartesian3(x + below, y + below, z + below),
            material: Material.fromType('Color', {color: Color.fromCssColorString('#4b5b69')}),
        }));
        Object.assign(this, {scene, globe});
        surface.addTo(scene, sentence => this.onProblem?.(sentence));
        scene.renderError.addEventListener((_, error) => this.onProblem?.(String(error)));
        this.resize();
        new ResizeObserver(() => this.resize()).observe(canvas);
        const draw = () => {
            requestAnimationFrame(draw);
            this.onFrame?.(performance.now());
            if (!canvas.width || !canvas.height) return;
            scene.initializeFrame();
            scene.render();
        };
        draw();
    }

    resize() {
        const {canvas, scene} = this, ratio = Math.min(window.devicePixelRatio || 1, 2);
        canvas.width = Math.round(canvas.clientWidth * ratio);
        canvas.height = Math.round(canvas.clientHeight * ratio);
        scene.pixelRatio = ratio;
        if (canvas.width && canvas.height) scene.camera.frustum.aspectRatio = canvas.width / canvas.height;
        scene.requestRender();
    }

    set exaggeration(times) {
        this.scene.verticalExaggeration = times;
        this.scene.requestRender();
    }

    set contours(are) {
        this.surface.contours = are;
        this.scene.requestRender();
    }

    set wires(are) {
        this.surface.wires = are;
        this.scene.requestRender();
    }

    /** {finest, coarsest}: levels that the tiles in the picture are of, or were cut from; undefined: none yet. */
    shownLevels() {
        const {shown} = this.surface;
        return shown.length ? {finest: Math.max(...shown), coarsest: Math.min(...shown)} : undefined;
    }

    /** Where the eye is and looks: degrees, metres above the ellipsoid. */
    get camera() {
        const {positionCartographic: at, heading, pitch} = this.scene.camera, degrees = radians => radians * 180 / Math.PI;
        return {longitude: degrees(at.longitude), latitude: degrees(at.latitude), height: at.height, heading: degrees(heading), pitch: degrees(pitch)};
    }

    set camera({longitude, latitude, height, heading, pitch}) {
        const radians = degrees => degrees * Math.PI / 180;
        this.scene.camera.setView({
            destination: Cartesian3.fromDegrees(longitude, latitude, height), orientation: {heading: radians(heading), pitch: radians(pitch), roll: 0},
        });
        this.scene.requestRender();
    }

    /**
     * Metres above the ellipsoid at places [longitude, latitude] in degrees, as Cesium reads them from quantized-mesh of a level, or from
     * the finest ones that there are (level undefined); null where the tiles have no terrain.
     */
    async sample(places, level) {
        const at = places.map(([longitude, latitude]) => Cartographic.fromDegrees(longitude, latitude, NaN));
        await (level === undefined ? sampleTerrainMostDetailed(this.sampled.provider, at) : sampleTerrain(this.sampled.provider, level, at));
        return at.map(({height}) => Number.isFinite(height) ? height : null);
    }

    /** The place under CSS pixels of the canvas: {longitude, latitude, height}, or null. */
    pick(x, y) {
        const point = this.surface.pick({x, y});
        if (!point) return null;
        const {longitude, latitude, height} = Cartographic.fromCartesian(point);
        return {longitude: longitude * 180 / Math.PI, latitude: latitude * 180 / Math.PI, height};
    }

    /** When every tile that the picture needs is in it. */
    async settled() {
        const frame = () => new Promise(resolve => requestAnimationFrame(resolve));
        for (let quiet = 0; quiet < 5; quiet = this.surface.isLoaded && this.shownLevels() ? quiet + 1 : 0) {
            this.scene.requestRender();
            await frame();
        }
    }
}
