// Small runs of `helio bench vt`, `lod` and `points`: every documented key is there and the
// pictures are right. Times are printed, not judged.
//
//   node stream.mjs --helio build/bin/helio vt|lod|points --models FOLDER
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const args = process.argv.slice(2);
const take = (name) => {
    const at = args.indexOf(name);
    assert.ok(at >= 0, `${name} is missing`);
    return args.splice(at, 2)[1];
};
const helio = take("--helio");
const models = take("--models");
const [name] = args;
const folder = mkdtempSync(join(tmpdir(), "helio-bench-"));

const file = (path) => {
    const full = join(models, path);
    assert.ok(existsSync(full), `not made: ${full}`);
    return full;
};
const small = { width: 320, height: 180, frames: 6, stills: 2, samples: 2 };
const runs = {
    vt: {
        options: () => ({ ...small, made: 4, side_px: 1024, teleports: 6, sheets: [4096],
            budget_mib: 32, peer_mib: 2,
            images: [file("large.png")] }),
        keys: ["slowdown", "frame_ms.streamed", "frame_ms.resident", "teleport_ms.p50",
            "teleport_ms.p95", "peak_bytes", "budget_bytes", "set_bytes", "set_ratio",
            "final.pictures", "final.identical", "sheets.0.side_px", "sheets.0.sharp_ms.p50",
            "sheets.0.texel_error", "process.streamed_peak_rss_bytes", "prefetch.pages_missing_ratio", "peer.system",
            "peer.samples_ratio", "peer.bytes_ratio", "device"],
        check(r) {
            assert.equal(r.final.identical, r.final.pictures, "pictures depend on the budget");
            assert.ok(r.peak_bytes > 0 && r.peak_bytes <= r.budget_bytes, "the budget is exceeded");
            assert.equal(r.teleport_ms.count, 6);
            assert.ok(r.set_ratio > 5, "everything fits: nothing is streamed");
            assert.ok(r.sheets[0].texel_error <= 6, JSON.stringify(r.sheets));
            const { off, on } = r.prefetch;
            assert.ok(off.frame_ms.count === 18 && on.frame_ms.count === 18);
            assert.ok(off.pages_missing > 0 && off.pages_loaded > 0, JSON.stringify(r.prefetch));
            assert.ok(on.pages_missing <= 2 * off.pages_missing, JSON.stringify(r.prefetch));
            const p = r.peer; // both really sampled the same textures, which they had to read
            assert.ok(p.images === 5 && p.samples > 1e6, JSON.stringify(p));
            assert.ok(p.samples_per_s > 0 && p.our_samples_per_s > 0, JSON.stringify(p));
            assert.ok(p.set_bytes > 10 * p.memory_bytes, JSON.stringify(p));
            assert.ok(p.bytes_read > 1e5 && p.our_bytes_read > 1e5, JSON.stringify(p));
            assert.ok(p.texel_bytes > p.memory_bytes && p.our_texel_bytes > p.memory_bytes,
                JSON.stringify(p));
            assert.ok(p.mean_difference < 0.002, JSON.stringify(p));
        },
    },
    points: {
        options: () => ({ ...small, points: 200000, frames: 3, budget_mib: 8 }),
        keys: ["points", "make_ms", "bake_ms", "frame_ms.p50", "sharp_ms.p50", "triangles_drawn",
            "frames_missing", "settle_ms", "covered", "geometry.budget_bytes", "geometry.peak_bytes",
            "process.peak_rss_bytes", "device"],
        check(r) {
            assert.equal(r.points, 200000);
            assert.equal(r.frame_ms.count, 3);
            assert.ok(r.triangles_drawn > 1000, "nothing was drawn");
            assert.ok(r.covered > 0.2, "the terrain is not in the picture");
            assert.ok(r.geometry.peak_bytes <= r.geometry.budget_bytes, "the budget is exceeded");
        },
    },
    lod: {
        options: () => ({ ...small, cells: 96, tiles: 3, statues: 48, budget_mib: 256,
            heights: file("heights.png"),
            statue: file("statue.ply.gz") }),
        keys: ["scale.triangle_ratio", "scale.frame_time_ratio", "scale.cpu_time_ratio",
            "scale.thin_frame_time_ratio", "scale.covered_frame_time_ratio", "scale.large_triangles",
            "scale.hundred_drawn", "scale.base_ms.p50", "scale.hundred_cpu_ms.p50",
            "scale.large_unique_triangles", "disk.bytes_per_triangle", "bake.triangles_per_s", "image.psnr_db", "image.flip", "image.holes_px", "image.depth_off_px", "image.depth_far_px",
            "geometry.budget_bytes", "geometry.peak_bytes", "process.peak_rss_bytes", "device"],
        check(r) {
            assert.ok(r.scale.large_triangles > 9e6 && r.scale.thin_triangle_ratio > 10);
            assert.ok(r.scale.triangle_ratio > 90, JSON.stringify(r.scale));
            assert.ok(r.scale.base_covered > 0.999 && r.scale.hundred_covered > 0.999);
            assert.ok(r.image.psnr_db >= 38 && r.image.flip <= 0.02, JSON.stringify(r.image));
            assert.equal(r.image.holes_px, 0);
            assert.ok(r.image.depth_far_px <= 1, JSON.stringify(r.image));
            assert.ok(r.image.depth_off_px <= 2e-4 * r.image.depth_px, JSON.stringify(r.image));
            assert.ok(r.disk.bytes_per_triangle <= 16, JSON.stringify(r.disk));
            assert.ok(r.geometry.peak_bytes <= r.geometry.budget_bytes, "the budget is exceeded");
        },
    },
};

try {
    const run = runs[name];
    assert.ok(run, `no such benchmark: ${name}`);
    const json = join(folder, "result.json");
    const child = spawnSync(helio, ["bench", name, "--json", json, "--cache-dir", join(folder, "cache"),
        "--options", JSON.stringify(run.options())], { stdio: ["ignore", "inherit", "inherit"] });
    assert.equal(child.status, 0, `helio bench ${name} ended with ${child.status}`);
    const result = JSON.parse(readFileSync(json, "utf8"));
    for (const key of run.keys)
        assert.notEqual(key.split(".").reduce((o, k) => o?.[k], result), undefined, `no key ${key}`);
    console.log(JSON.stringify(result, null, 1));
    run.check(result);
} finally {
    rmSync(folder, { recursive: true, force: true });
}
