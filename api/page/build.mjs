// Bundles the page into dist/: one script for everything that is seen at once, one for frames, one for the worker that reads HDF5.
import { build } from "esbuild";
import { copyFileSync, mkdirSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { gzipSync } from "node:zlib";

rmSync("dist", { recursive: true, force: true });
mkdirSync("dist", { recursive: true });
const common = {
    bundle: true,
    minify: true,
    format: "esm",
    target: "es2022",
    legalComments: "linked",
    logLevel: "warning",
};
await build({
    ...common,
    entryPoints: { page: "src/main.tsx" },
    outdir: "dist",
    splitting: true,
    chunkNames: "[name]-[hash]",
    jsx: "automatic",
    jsxImportSource: "preact",
});
// A worker is a program of its own.
await build({ ...common, entryPoints: { "frame-reader": "src/frame/reader.ts" }, outdir: "dist" });
copyFileSync("src/index.html", "dist/index.html");
copyFileSync("src/icon.svg", "dist/icon.svg");

const sizes = readdirSync("dist").map((name) => [name, gzipSync(readFileSync(`dist/${name}`)).length]);
const first = sizes.filter(([name]) => !name.startsWith("frame-reader")).reduce((sum, [, size]) => sum + size, 0);
console.log(`page: ${(first / 1000).toFixed(0)} kB compressed, without the reader of frames`);
if (first > 600_000) {
    console.error("the page is larger than 600 kB");
    process.exit(1);
}
