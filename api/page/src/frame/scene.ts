// Points and surfaces on a canvas. Nothing is drawn unless something has changed.
import {
    BufferAttribute, BufferGeometry, DataTexture, DoubleSide, LineBasicMaterial, LineSegments, Mesh, OrthographicCamera, PerspectiveCamera,
    Points, Scene as ThreeScene, ShaderMaterial, Vector3, WebGLRenderer, type Camera,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { table } from "./colors";
import type { Frame } from "./reader";

export interface Look {
    /** A value for each point. */
    values: Float32Array | null;
    low: number;
    high: number;
    map: string;
    /** Points of the surface that are drawn as dots over the others. */
    surface: Float32Array | null;
    normals: Float32Array | null;
    hasGlyphs: boolean;
    /** Share of the extent along an axis behind which nothing is shown; 1 shows all. */
    clip: { axis: 0 | 1 | 2; share: number };
}

const VERTEX = `
    attribute float value;
    attribute vec3 direction;
    uniform float size, low, high, scale;
    uniform vec3 clipNormal;
    varying float share;
    varying vec3 facing;
    varying float depth;
    void main() {
        share = high > low ? clamp((value - low) / (high - low), 0.0, 1.0) : 0.5;
        if (!(value == value)) share = -1.0;
        facing = normalMatrix * direction;
        depth = dot(position, clipNormal);
        vec4 seen = modelViewMatrix * vec4(position, 1.0);
        gl_Position = projectionMatrix * seen;
        gl_PointSize = max(1.5, projectionMatrix[2][3] == 0.0 ? size * scale * projectionMatrix[1][1] : size * scale * projectionMatrix[1][1] / -seen.z);
    }`;

const FRAGMENT = `
    uniform sampler2D colors;
    uniform float clipAt;
    uniform bool isLit, isDisc;
    uniform vec3 plain;
    uniform bool isPlain;
    varying float share;
    varying vec3 facing;
    varying float depth;
    void main() {
        if (depth > clipAt) discard;
        vec2 place = 2.0 * gl_PointCoord - 1.0;
        if (isDisc && dot(place, place) > 1.0) discard;
        vec3 color = isPlain ? plain : share < 0.0 ? vec3(0.62) : texture2D(colors, vec2(share, 0.5)).rgb;
        float light = 1.0;
        if (isLit && dot(facing, facing) > 0.0) light = 0.35 + 0.65 * abs(normalize(facing).z);
        gl_FragColor = vec4(color * light, 1.0);
    }`;

/** Glyphs that are drawn at most: more hide each other. */
const MOST_GLYPHS = 4000;

export class FrameScene {
    private readonly renderer: WebGLRenderer;
    private readonly scene = new ThreeScene();
    private camera: Camera & { updateProjectionMatrix(): void };
    private controls: OrbitControls;
    private frame: Frame | null = null;
    private drawing = 0;
    private isFlat = true;
    private center = new Vector3();
    private radius = 1;
    private spacing = 0.1;
    private readonly watch: ResizeObserver;
    private linked: FrameScene[] = [];

    constructor(private readonly canvas: HTMLCanvasElement) {
        this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
        this.renderer.setClearColor(0x000000, 0);
        this.camera = new OrthographicCamera();
        this.controls = this.control();
        this.watch = new ResizeObserver(() => this.resize());
        this.watch.observe(canvas.parentElement ?? canvas);
    }

    private control(): OrbitControls {
        const controls = new OrbitControls(this.camera, this.canvas);
        controls.enableRotate = !this.isFlat;
        controls.screenSpacePanning = true;
        controls.addEventListener("change", () => {
            this.draw();
            this.linked.forEach((other) => other.follow(this));
        });
        return controls;
    }

    /** Moves the cameras of others along. */
    link(others: FrameScene[]): void {
        this.linked = others.filter((other) => other !== this);
    }

    private follow(other: FrameScene): void {
        this.camera.position.copy(other.camera.position);
        this.camera.quaternion.copy(other.camera.quaternion);
        this.controls.target.copy(other.controls.target);
        if (this.camera instanceof OrthographicCamera && other.camera instanceof OrthographicCamera) this.camera.zoom = other.camera.zoom;
        this.camera.updateProjectionMatrix();
        this.draw();
    }

    /** Shows a frame. The view stays where it is while the frames are of the same kind. */
    show(frame: Frame, look: Look): void {
        const isFirst = this.frame === null;
        this.frame = frame;
        if (isFirst) this.measure(frame);
        this.scene.clear();
        const geometry = new BufferGeometry();
        const count = frame.positions.length / 3;
        geometry.setAttribute("position", new BufferAttribute(frame.positions, 3));
        geometry.setAttribute("value", new BufferAttribute(look.values ?? new Float32Array(count), 1));
        geometry.setAttribute("direction", new BufferAttribute(look.normals ?? new Float32Array(3 * count), 3));
        const hasTriangles = frame.triangles.length > 0;
        const material = this.material(look, hasTriangles ? { isDisc: false, isLit: true } : { isDisc: true, isLit: look.normals !== null && !this.isFlat });
        if (hasTriangles) {
            geometry.setIndex(new BufferAttribute(frame.triangles, 1));
            if (!look.normals) {
                geometry.computeVertexNormals();
                geometry.setAttribute("direction", geometry.getAttribute("normal"));
            }
            this.scene.add(new Mesh(geometry, material));
        } else {
            this.scene.add(new Points(geometry, material));
        }
        if (look.surface) this.addSurface(look.surface, look);
        if (look.hasGlyphs && look.normals) this.addGlyphs(frame.positions, look.normals);
        this.draw();
    }

    private material(look: Look, shape: { isDisc: boolean; isLit: boolean }, plain?: [number, number, number]): ShaderMaterial {
        const colors = new DataTexture(table(look.map), 256, 1);
        colors.needsUpdate = true;
        const normal = new Vector3().setComponent(look.clip.axis, 1);
        const middle = this.center.getComponent(look.clip.axis);
        const clipAt = look.clip.share >= 1 ? 1e30 : middle + this.radius * (2 * look.clip.share - 1);
        return new ShaderMaterial({
            vertexShader: VERTEX,
            fragmentShader: FRAGMENT,
            side: DoubleSide,
            uniforms: {
                // Discs of a surface lap over each other, so that it looks closed.
                size: { value: this.spacing * (plain ? 0.35 : shape.isLit ? 2.4 : 1.05) }, low: { value: look.low }, high: { value: look.high }, scale: { value: this.canvas.height / 2 },
                colors: { value: colors }, clipNormal: { value: normal }, clipAt: { value: clipAt }, isLit: { value: shape.isLit }, isDisc: { value: shape.isDisc },
                isPlain: { value: plain !== undefined }, plain: { value: new Vector3(...(plain ?? [0, 0, 0])) },
            },
        });
    }

    /** Closest points of the narrow band lie on the surface: drawn as dots they show it. */
    private addSurface(surface: Float32Array, look: Look): void {
        const geometry = new BufferGeometry();
        const kept: number[] = [];
        const lift = this.isFlat ? this.radius * 1e-3 : 0;
        for (let k = 0; k < surface.length; k += 3) {
            const [x, y, z] = [surface[k] as number, surface[k + 1] as number, surface[k + 2] as number];
            if (Number.isFinite(x + y + z)) kept.push(x, y, z + lift);
        }
        geometry.setAttribute("position", new BufferAttribute(Float32Array.from(kept), 3));
        geometry.setAttribute("value", new BufferAttribute(new Float32Array(kept.length / 3), 1));
        geometry.setAttribute("direction", new BufferAttribute(new Float32Array(kept.length), 3));
        this.scene.add(new Points(geometry, this.material(look, { isDisc: true, isLit: false }, [0.07, 0.07, 0.09])));
    }

    private addGlyphs(positions: Float32Array, normals: Float32Array): void {
        const count = positions.length / 3;
        const stride = Math.max(1, Math.ceil(count / MOST_GLYPHS));
        const ends: number[] = [];
        for (let k = 0; k < count; k += stride) {
            const [p, n] = [positions.subarray(3 * k, 3 * k + 3), normals.subarray(3 * k, 3 * k + 3)];
            if (!Number.isFinite((n[0] as number) + (n[1] as number) + (n[2] as number))) continue;
            for (let c = 0; c < 3; c += 1) ends.push(p[c] as number);
            for (let c = 0; c < 3; c += 1) ends.push((p[c] as number) + 2 * this.spacing * (n[c] as number));
        }
        const geometry = new BufferGeometry();
        geometry.setAttribute("position", new BufferAttribute(Float32Array.from(ends), 3));
        this.scene.add(new LineSegments(geometry, new LineBasicMaterial({ color: 0xd55e00 })));
    }

    /** Extent and spacing of the first frame, and the view that they ask for. */
    private measure(frame: Frame): void {
        const low = new Vector3(Infinity, Infinity, Infinity);
        const high = new Vector3(-Infinity, -Infinity, -Infinity);
        const point = new Vector3();
        const count = frame.positions.length / 3;
        for (let k = 0; k < count; k += 1) {
            point.fromArray(frame.positions, 3 * k);
            low.min(point);
            high.max(point);
        }
        const extent = new Vector3().subVectors(high, low);
        this.center.addVectors(low, high).multiplyScalar(0.5);
        this.radius = Math.max(extent.length() / 2, 1e-12);
        this.isFlat = extent.z < 1e-9 * this.radius;
        const measureOf = this.isFlat ? extent.x * extent.y : extent.x * extent.y * extent.z;
        const estimate = this.isFlat ? Math.sqrt(measureOf / count) : Math.cbrt(measureOf / count);
        this.spacing = nearest(frame.positions, estimate);
        this.reset();
    }

    /** Back to the whole. */
    reset(): void {
        this.controls.dispose();
        if (this.isFlat) {
            const camera = new OrthographicCamera(-1, 1, 1, -1, -10 * this.radius, 10 * this.radius);
            camera.position.set(this.center.x, this.center.y, this.center.z + this.radius);
            this.camera = camera;
        } else {
            const camera = new PerspectiveCamera(35, 1, this.radius / 100, 100 * this.radius);
            camera.up.set(0, 0, 1);
            camera.position.copy(this.center).add(new Vector3(1.6, -2.4, 1.4).normalize().multiplyScalar(3.6 * this.radius));
            this.camera = camera;
        }
        this.controls = this.control();
        this.controls.target.copy(this.center);
        this.resize();
        this.controls.update();
    }

    private resize(): void {
        const place = this.canvas.parentElement ?? this.canvas;
        const width = Math.max(place.clientWidth, 1);
        const height = Math.max(place.clientHeight, 1);
        this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
        this.renderer.setSize(width, height, false);
        const aspect = width / height;
        if (this.camera instanceof PerspectiveCamera) this.camera.aspect = aspect;
        else if (this.camera instanceof OrthographicCamera) {
            const half = this.radius * 0.78;
            const [x, y] = aspect > 1 ? [half * aspect, half] : [half, half / aspect];
            Object.assign(this.camera, { left: -x, right: x, top: y, bottom: -y });
        }
        this.camera.updateProjectionMatrix();
        this.draw();
    }

    private draw(): void {
        if (this.drawing) return;
        this.drawing = requestAnimationFrame(() => {
            this.drawing = 0;
            this.drawNow();
        });
    }

    /** Draws at once; the time that it took in milliseconds, the graphics included. */
    drawNow(): number {
        const began = performance.now();
        this.renderer.render(this.scene, this.camera);
        // Reading a pixel waits for the whole picture.
        const gl = this.renderer.getContext();
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
        return performance.now() - began;
    }

    /** The point nearest to a place of the canvas (in its own pixels); -1 where none is near. */
    pick(x: number, y: number): number {
        if (!this.frame) return -1;
        const { positions } = this.frame;
        const { clientWidth: width, clientHeight: height } = this.canvas;
        const point = new Vector3();
        let found = -1;
        let least = 12 * 12;
        let depth = Infinity;
        for (let k = 0; 3 * k < positions.length; k += 1) {
            point.fromArray(positions, 3 * k).project(this.camera);
            const dx = ((point.x + 1) / 2) * width - x;
            const dy = ((1 - point.y) / 2) * height - y;
            const distance = dx * dx + dy * dy;
            if (distance < least - 1 || (distance < least && point.z < depth)) {
                found = k;
                least = distance;
                depth = point.z;
            }
        }
        return found;
    }

    picture(): Promise<Blob | null> {
        this.drawNow();
        return new Promise((resolve) => this.canvas.toBlob(resolve, "image/png"));
    }

    dispose(): void {
        cancelAnimationFrame(this.drawing);
        this.watch.disconnect();
        this.controls.dispose();
        this.renderer.dispose();
        this.renderer.forceContextLoss();
    }
}

/** The usual gap between neighbors: the median over some points, found in a grid of cells. */
function nearest(positions: Float32Array, estimate: number): number {
    const count = positions.length / 3;
    const cell = Math.max(estimate * 2, 1e-12);
    const cells = new Map<string, number[]>();
    const keyOf = (k: number, shift: [number, number, number]) => [0, 1, 2].map((c) => Math.floor((positions[3 * k + c] as number) / cell) + (shift[c] as number)).join();
    const limit = Math.min(count, 20_000);
    for (let k = 0; k < limit; k += 1) {
        const key = keyOf(k, [0, 0, 0]);
        const held = cells.get(key);
        if (held) held.push(k);
        else cells.set(key, [k]);
    }
    const gaps: number[] = [];
    for (let k = 0; k < limit; k += Math.max(1, Math.floor(limit / 300))) {
        let least = Infinity;
        for (let dx = -1; dx <= 1; dx += 1) for (let dy = -1; dy <= 1; dy += 1) for (let dz = -1; dz <= 1; dz += 1) {
            for (const other of cells.get(keyOf(k, [dx, dy, dz])) ?? []) {
                if (other === k) continue;
                let square = 0;
                for (let c = 0; c < 3; c += 1) square += ((positions[3 * k + c] as number) - (positions[3 * other + c] as number)) ** 2;
                least = Math.min(least, square);
            }
        }
        if (Number.isFinite(least)) gaps.push(Math.sqrt(least));
    }
    gaps.sort((a, b) => a - b);
    return gaps[Math.floor(gaps.length / 2)] ?? estimate;
}
