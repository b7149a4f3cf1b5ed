// tileset.js - a terrain as 3D Tiles in Cesium's scene: coloured by height and lit as the globe is, with the error of every
// tile as its subtree states it.

import {Cartographic, Cesium3DTileset, CustomShader, LightingModel, TextureUniform, UniformType} from '@cesium/engine';
import {tilesPath} from '../service.js';

/** Heights above the ellipsoid are taken along the radius, which the normal leaves by 0.2 degrees at most. */
const FRAGMENT = `
void fragmentMain(FragmentInput fsInput, inout czm_modelMaterial material) {
    vec3 place = fsInput.attributes.positionWC;
    float height = length(place) * (1.0 - 1.0 / length(place * czm_ellipsoidInverseRadii));
    vec3 colour = texture(u_ramp, vec2((height - u_heights.x) / (u_heights.y - u_heights.x), 0.5)).rgb;
    float at = height / u_spacing, line = abs(fract(at + 0.5) - 0.5) / max(fwidth(at), 1e-6);
    colour = mix(colour, vec3(0.2, 0.15, 0.1), u_contours * 0.45 * (1.0 - smoothstep(0.5, 1.0, line)));
    float lambert = max(dot(normalize(fsInput.attributes.normalEC), czm_lightDirectionEC), 0.0);
    // Colours of the screen, as on the globe; Cesium takes what models give for linear.
    material.diffuse = czm_srgbToLinear(min(colour * czm_lightColor * min(u_light.x * lambert + u_light.y, 1.0), 1.0));
}`;

export class TilesetSurface {
    /** ramp: a canvas of one row, lowest to highest; light: [of the light, without it]; as globe.js has them. */
    static async create(terrain, {ramp, heights, spacing, light, pixels}) {
        const {width, height} = ramp, {data} = ramp.getContext('2d').getImageData(0, 0, width, height);
        const shader = new CustomShader({
            lightingModel: LightingModel.UNLIT,
            fragmentShaderText: FRAGMENT,
            uniforms: {
                u_ramp: {type: UniformType.SAMPLER_2D, value: new TextureUniform({typedArray: new Uint8Array(data), width, height, repeat: false})},
                u_heights: {type: UniformType.VEC2, value: {x: heights[0], y: heights[1]}},
                u_light: {type: UniformType.VEC2, value: {x: light[0], y: light[1]}},
                u_spacing: {type: UniformType.FLOAT, value: spacing},
                u_contours: {type: UniformType.FLOAT, value: 0},
            },
        });
        const tileset = await Cesium3DTileset.fromUrl(`${tilesPath(terrain.id, '3d-tiles')}/tileset.json`, {
            customShader: shader, maximumScreenSpaceError: pixels, backFaceCulling: false, environmentMapOptions: {enabled: false},
        });
        return new TilesetSurface(tileset, shader);
    }

    constructor(tileset, shader) {
        const {errors} = tileset.extras.rqt;
        Object.assign(this, {tileset, shader, levels: {errors, finest: errors.length - 1}});
    }

    addTo(scene, complain) {
        this.scene = scene;
        scene.globe.show = false;
        scene.primitives.add(this.tileset);
        this.tileset.tileFailed.addEventListener(({message}) => complain(message));
    }

    set isShown(is) {
        this.tileset.show = is;
    }

    set contours(are) {
        this.shader.setUniform('u_contours', are ? 1 : 0);
    }

    set wires(are) {
        this.tileset.debugWireframe = are;
    }

    /** Cesium has no public door to what it has chosen. */
    get shown() {
        return this.tileset._selectedTiles.filter(({implicitCoordinates}) => implicitCoordinates).map(({implicitCoordinates: {level}}) => level);
    }

    get isLoaded() {
        return this.tileset.tilesLoaded;
    }

    pick(at) {
        return this.scene.pickPosition(at);
    }

    /** Metres above the ellipsoid that are seen at places [longitude, latitude] in degrees, of the finest tiles; null: nothing. */
    async sample(places) {
        const at = places.map(([longitude, latitude]) => Cartographic.fromDegrees(longitude, latitude));
        await this.scene.sampleHeightMostDetailed(at);
        return at.map(({height}) => Number.isFinite(height) ? height : null);
    }
}
