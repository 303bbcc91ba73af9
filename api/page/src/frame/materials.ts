// How points and triangles are painted.
import { DataTexture, DoubleSide, ShaderMaterial, Vector3 } from "three";
import { table } from "./colors";

/** What points and triangles have in common: the color of a value, and the light on it. */
const COMMON = `
    uniform float low, high, clipAt;
    uniform bool isLit, isPlain;
    uniform vec3 plain, clipNormal;
    uniform sampler2D colors;
    float shareOf(float value) {
        if (!(value == value)) return -1.0;
        return high > low ? clamp((value - low) / (high - low), 0.0, 1.0) : 0.5;
    }
    vec3 colorOf(float share) {
        return isPlain ? plain : share < 0.0 ? vec3(0.62) : texture2D(colors, vec2(share, 0.5)).rgb;
    }
    float lightOn(vec3 facing) {
        return isLit && dot(facing, facing) > 0.0 ? 0.35 + 0.65 * abs(normalize(facing).z) : 1.0;
    }`;

/** A point has one color, so the work is done for points, not for pixels: they lap over each other many times. */
const POINT_VERTEX = `${COMMON}
    attribute float value;
    attribute vec3 direction;
    uniform float size, scale;
    varying vec3 color;
    void main() {
        color = colorOf(shareOf(value)) * lightOn(normalMatrix * direction);
        vec4 seen = modelViewMatrix * vec4(position, 1.0);
        // What is cut away lies outside of the view.
        gl_Position = dot(position, clipNormal) > clipAt ? vec4(2.0, 2.0, 2.0, 1.0) : projectionMatrix * seen;
        float near = projectionMatrix[2][3] == 0.0 ? 1.0 : -seen.z;
        gl_PointSize = max(1.5, size * scale * projectionMatrix[1][1] / near);
    }`;

const POINT_FRAGMENT = `
    varying vec3 color;
    void main() {
        #ifdef ROUND
        vec2 place = 2.0 * gl_PointCoord - 1.0;
        if (dot(place, place) > 1.0) discard;
        #endif
        gl_FragColor = vec4(color, 1.0);
    }`;

const TRIANGLE_VERTEX = `${COMMON}
    attribute float value;
    attribute vec3 direction;
    varying float share, depth;
    varying vec3 facing;
    void main() {
        share = shareOf(value);
        facing = normalMatrix * direction;
        depth = dot(position, clipNormal);
        gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
    }`;

const TRIANGLE_FRAGMENT = `${COMMON}
    varying float share, depth;
    varying vec3 facing;
    void main() {
        if (depth > clipAt) discard;
        gl_FragColor = vec4(colorOf(share) * lightOn(facing), 1.0);
    }`;

export interface Paint {
    map: string;
    low: number;
    high: number;
    isLit: boolean;
    /** One color for all instead of the map. */
    plain?: [number, number, number];
    /** What lies behind this plane is not shown. */
    clipNormal: Vector3;
    clipAt: number;
}

function uniforms(paint: Paint) {
    const colors = new DataTexture(table(paint.map), 256, 1);
    colors.needsUpdate = true;
    return {
        low: { value: paint.low }, high: { value: paint.high }, colors: { value: colors },
        isLit: { value: paint.isLit }, isPlain: { value: paint.plain !== undefined }, plain: { value: new Vector3(...(paint.plain ?? [0, 0, 0])) },
        clipNormal: { value: paint.clipNormal }, clipAt: { value: paint.clipAt },
    };
}

export function triangleMaterial(paint: Paint): ShaderMaterial {
    return new ShaderMaterial({ vertexShader: TRIANGLE_VERTEX, fragmentShader: TRIANGLE_FRAGMENT, side: DoubleSide, uniforms: uniforms(paint) });
}

/** Two materials for points of a size in the scene's units: round ones for a picture at rest, square ones, which cost less, for one
 *  that moves. Both have the same uniforms. */
export function pointMaterials(paint: Paint, size: number): { round: ShaderMaterial; square: ShaderMaterial } {
    const shared = { ...uniforms(paint), size: { value: size }, scale: { value: 1 } };
    const made = (defines: Record<string, string>) => {
        const material = new ShaderMaterial({ vertexShader: POINT_VERTEX, fragmentShader: POINT_FRAGMENT, defines });
        material.uniforms = shared;
        return material;
    };
    return { round: made({ ROUND: "" }), square: made({}) };
}
