// Points and surfaces on a canvas. Nothing is drawn unless something has changed.
import {
    BufferAttribute, BufferGeometry, LineBasicMaterial, LineSegments, Mesh, OrthographicCamera, PerspectiveCamera, Points,
    Scene as ThreeScene, Vector3, WebGLRenderer, type Camera, type ShaderMaterial,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { pointMaterials, triangleMaterial, type Paint } from "./materials";
import { frontToBack } from "./order";
import type { Frame } from "./reader";
import { usualGap } from "./spacing";

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

/** Glyphs that are drawn at most: more hide each other. */
const MOST_GLYPHS = 4000;
/** A view that has not moved for this long rests. */
const REST_MS = 250;
/** Pixels of the canvas by those of the page at rest: edges are smooth. */
const FINE_PIXELS = 2;
/** Where a picture takes longer, none is drawn finer than the screen. */
const SLOW_MS = 500;
/** Cosine of the angle by which a view turns before its points are ordered anew. */
const SAME_DIRECTION = 0.98;

/** What a key does to a view: share of the radius that it moves, angle that it turns, factor of its zoom. */
const KEY_SHARE = 0.1;
const KEY_ANGLE = 0.1;
const KEY_ZOOM = 1.2;

/** Distance in spacings within which the closest points of particles are shown. */
const NEXT_TO_SURFACE = 1.5;
/** Time of a picture of a view that moves: where all points take longer, some of them stand for all, as larger squares. */
const MOVING_MS = 80;

/** Points that are drawn, in two ways. */
interface Cloud {
    points: Points;
    round: ShaderMaterial;
    square: ShaderMaterial;
    /** The direction by which they are ordered, and one of how many is drawn. */
    direction: Vector3 | null;
    stride: number;
    /** Size of a point that stands for itself alone. */
    size: number;
    /** Dimension of what the points fill. */
    dimension: number;
}

function geometryOf(positions: Float32Array, values: Float32Array | null, directions: Float32Array | null): BufferGeometry {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(positions, 3));
    geometry.setAttribute("value", new BufferAttribute(values ?? new Float32Array(positions.length / 3), 1));
    geometry.setAttribute("direction", new BufferAttribute(directions ?? new Float32Array(positions.length), 3));
    return geometry;
}

export class FrameScene {
    private readonly renderer: WebGLRenderer;
    private readonly scene = new ThreeScene();
    private camera: Camera & { updateProjectionMatrix(): void };
    private controls: OrbitControls;
    private frame: Frame | null = null;
    private look: Look | null = null;
    private drawing = 0;
    private isFlat = true;
    private center = new Vector3();
    private radius = 1;
    private spacing = 0.1;
    private readonly watch: ResizeObserver;
    private linked: FrameScene[] = [];
    private clouds: Cloud[] = [];
    /** Until the view rests again, in the clock of the page. */
    private movesUntil = 0;
    private rest = 0;
    /** Whether a picture at rest took long. */
    private isSlow = false;
    /** While the view moves, one of so many points is drawn. */
    private stride = 1;
    /** Pictures of this frame in a view that moved. */
    private moving = 0;

    constructor(private readonly canvas: HTMLCanvasElement) {
        this.renderer = new WebGLRenderer({ canvas, antialias: false, alpha: true, preserveDrawingBuffer: true });
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
            this.move();
            this.linked.forEach((other) => other.follow(this));
        });
        return controls;
    }

    /** Moves the cameras of others along. */
    link(others: FrameScene[]): void {
        this.linked = others.filter((other) => other !== this);
    }

    private follow(other: FrameScene): void {
        // A flat picture has no side from which a ball could be seen, and the other way round.
        if (this.isFlat !== other.isFlat || !this.frame || !other.frame) return;
        // Frames of scenes of other places and sizes are seen from the same side, as large.
        const mapped = (place: Vector3) => new Vector3().subVectors(place, other.center).multiplyScalar(this.radius / other.radius).add(this.center);
        this.camera.position.copy(mapped(other.camera.position));
        this.camera.quaternion.copy(other.camera.quaternion);
        this.controls.target.copy(mapped(other.controls.target));
        if (this.camera instanceof OrthographicCamera && other.camera instanceof OrthographicCamera) this.camera.zoom = other.camera.zoom;
        this.camera.updateProjectionMatrix();
        this.move();
    }

    /** Draws a view that moves: quickly now, and well as soon as it rests. */
    private move(): void {
        this.movesUntil = performance.now() + REST_MS;
        window.clearTimeout(this.rest);
        this.rest = window.setTimeout(() => this.draw(), REST_MS);
        this.draw();
    }

    /** Shows a frame. The view stays where it is while the frames are of the same kind. */
    show(frame: Frame, look: Look): void {
        const isFirst = this.frame === null;
        this.frame = frame;
        this.look = look;
        if (isFirst) this.measure(frame);
        [this.stride, this.moving] = [1, 0];
        this.clear();
        const isLit = look.normals !== null && !this.isFlat;
        const paint = { map: look.map, low: look.low, high: look.high, ...this.clipOf(look) };
        if (frame.triangles.length > 0) {
            const geometry = geometryOf(frame.positions, look.values, look.normals);
            geometry.setIndex(new BufferAttribute(frame.triangles, 1));
            if (!look.normals) {
                geometry.computeVertexNormals();
                geometry.setAttribute("direction", geometry.getAttribute("normal"));
            }
            this.scene.add(new Mesh(geometry, triangleMaterial({ ...paint, isLit: true })));
        } else {
            // Discs of a surface lap over each other, so that it looks closed.
            this.addCloud(frame.positions, look.values, look.normals, { ...paint, isLit }, isLit ? 2.4 : 1.05);
        }
        if (look.surface) this.addSurface(frame.positions, look.surface, paint);
        if (look.hasGlyphs && look.normals) this.addGlyphs(frame.positions, look.normals, this.clipOf(look));
        this.draw();
    }

    /** Takes all away, what the graphics hold of it too. */
    private clear(): void {
        for (const thing of this.scene.children as (Mesh | Points | LineSegments)[]) {
            thing.geometry.dispose();
            for (const material of [thing.material].flat()) {
                (material as Partial<ShaderMaterial>).uniforms?.colors?.value.dispose();
                material.dispose();
            }
        }
        this.clouds.forEach(({ round, square }) => [round, square].forEach((material) => material.dispose()));
        this.clouds = [];
        this.scene.clear();
    }

    private clipOf(look: Look): { clipNormal: Vector3; clipAt: number } {
        const middle = this.center.getComponent(look.clip.axis);
        const clipAt = look.clip.share >= 1 ? 1e30 : middle + this.radius * (2 * look.clip.share - 1);
        return { clipNormal: new Vector3().setComponent(look.clip.axis, 1), clipAt };
    }

    private addCloud(positions: Float32Array, values: Float32Array | null, directions: Float32Array | null, paint: Paint, spacings: number): void {
        const geometry = geometryOf(positions, values, directions);
        const size = spacings * this.spacing;
        const { round, square } = pointMaterials(paint, size);
        const points = new Points(geometry, round);
        const dimension = this.isFlat || paint.isLit || paint.plain ? 2 : 3;
        this.clouds.push({ points, round, square, direction: null, stride: 1, size, dimension });
        this.scene.add(points);
    }

    /** Closest points lie on the surface: drawn as dots they show it. Those of the particles next to it are enough. */
    private addSurface(positions: Float32Array, surface: Float32Array, paint: Omit<Paint, "isLit">): void {
        const kept: number[] = [];
        const lift = this.isFlat ? this.radius * 1e-3 : 0;
        for (let k = 0; k < surface.length; k += 3) {
            const [x, y, z] = [surface[k] as number, surface[k + 1] as number, surface[k + 2] as number];
            const distance = Math.hypot(x - (positions[k] as number), y - (positions[k + 1] as number), z - (positions[k + 2] as number));
            if (distance <= NEXT_TO_SURFACE * this.spacing) kept.push(x, y, z + lift);
        }
        this.addCloud(Float32Array.from(kept), null, null, { ...paint, isLit: false, plain: [0.07, 0.07, 0.09] }, 0.35);
    }

    private addGlyphs(positions: Float32Array, normals: Float32Array, { clipNormal, clipAt }: { clipNormal: Vector3; clipAt: number }): void {
        const count = positions.length / 3;
        const stride = Math.max(1, Math.ceil(count / MOST_GLYPHS));
        const ends: number[] = [];
        for (let k = 0; k < count; k += stride) {
            const [p, n] = [positions.subarray(3 * k, 3 * k + 3), normals.subarray(3 * k, 3 * k + 3)];
            if (!Number.isFinite((n[0] as number) + (n[1] as number) + (n[2] as number))) continue;
            if (clipNormal.dot(new Vector3().fromArray(p)) > clipAt) continue;
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
        this.spacing = usualGap(frame.positions, estimate);
        this.reset();
    }

    /** Back to the whole of the frame that is shown. */
    whole(): void {
        if (this.frame) this.measure(this.frame);
        if (this.frame && this.look) this.show(this.frame, this.look);
    }

    /** Turns, moves or zooms the view by a key; false for keys that mean nothing. */
    press(key: string): boolean {
        const steps: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
        const step = steps[key];
        const way = new Vector3().subVectors(this.camera.position, this.controls.target);
        if (step && this.isFlat) {
            const shift = new Vector3(step[0], step[1], 0).multiplyScalar(KEY_SHARE * this.radius);
            this.camera.position.add(shift);
            this.controls.target.add(shift);
        } else if (step) {
            const side = new Vector3().crossVectors(this.camera.up, way).normalize();
            way.applyAxisAngle(this.camera.up, KEY_ANGLE * step[0]).applyAxisAngle(side, -KEY_ANGLE * step[1]);
            this.camera.position.copy(this.controls.target).add(way);
        } else if (key === "+" || key === "-") {
            const factor = key === "+" ? KEY_ZOOM : 1 / KEY_ZOOM;
            if (this.camera instanceof OrthographicCamera) this.camera.zoom *= factor;
            else this.camera.position.copy(this.controls.target).add(way.divideScalar(factor));
            this.camera.updateProjectionMatrix();
        } else if (key === "0") {
            this.whole();
        } else {
            return false;
        }
        this.controls.update();
        this.move();
        this.linked.forEach((other) => other.follow(this));
        return true;
    }

    private reset(): void {
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
    drawNow(isMoving = performance.now() < this.movesUntil): number {
        const began = performance.now();
        const ratio = isMoving ? Math.min(devicePixelRatio, 1) : this.isSlow ? devicePixelRatio : Math.max(FINE_PIXELS, devicePixelRatio);
        if (ratio !== this.renderer.getPixelRatio()) this.renderer.setPixelRatio(ratio);
        for (const cloud of this.clouds) {
            cloud.points.material = isMoving ? cloud.square : cloud.round;
            Object.assign(cloud.round.uniforms.scale ?? {}, { value: this.canvas.height / 2 });
            this.order(cloud, isMoving ? this.stride : 1);
        }
        this.renderer.render(this.scene, this.camera);
        // Reading a pixel waits for the whole picture.
        const gl = this.renderer.getContext();
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
        const took = performance.now() - began;
        if (!isMoving) this.isSlow ||= took > SLOW_MS;
        // The first picture has to be prepared by the graphics and tells nothing.
        else if (this.moving > 0) this.stride = Math.max(this.stride, Math.ceil((this.stride * took) / MOVING_MS));
        if (isMoving) this.moving += 1;
        return took;
    }

    /** Orders the points of a cloud from front to back, anew once the view has turned or other points are drawn. */
    private order(cloud: Cloud, stride: number): void {
        const direction = this.isFlat ? new Vector3(0, 0, 1) : this.camera.getWorldDirection(new Vector3());
        if (cloud.stride === stride && cloud.direction && cloud.direction.dot(direction) > SAME_DIRECTION) return;
        Object.assign(cloud, { direction, stride });
        Object.assign(cloud.round.uniforms.size ?? {}, { value: cloud.size * stride ** (1 / cloud.dimension) });
        const { geometry } = cloud.points;
        const positions = geometry.getAttribute("position").array as Float32Array;
        const index = geometry.getIndex() ?? new BufferAttribute(new Uint32Array(positions.length / 3), 1);
        const count = frontToBack(positions, direction.toArray(), stride, index.array as Uint32Array);
        index.needsUpdate = true;
        geometry.setIndex(index);
        geometry.setDrawRange(0, count);
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
        const clip = this.look ? this.clipOf(this.look) : null;
        for (let k = 0; 3 * k < positions.length; k += 1) {
            point.fromArray(positions, 3 * k);
            if (clip && clip.clipNormal.dot(point) > clip.clipAt) continue;
            point.project(this.camera);
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
        this.drawNow(false);
        return new Promise((resolve) => this.canvas.toBlob(resolve, "image/png"));
    }

    dispose(): void {
        cancelAnimationFrame(this.drawing);
        window.clearTimeout(this.rest);
        this.clear();
        this.watch.disconnect();
        this.controls.dispose();
        this.renderer.dispose();
        this.renderer.forceContextLoss();
    }
}
