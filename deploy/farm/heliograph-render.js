// Job type of Flamenco 3.3 and later: put this file into the folder "scripts" beside flamenco-manager, and
// name the program in flamenco-manager.yaml (docs/operations.md):
//   variables: {helio: {values: [{platform: linux, value: /usr/bin/helio}]}}
//
// A task is a chunk of frames. It may be repeated, by any worker: frames that are there and whole stay, and
// one that was being path traced goes on from its checkpoint.
const JOB_TYPE = {
    label: "Heliograph Render",
    description: "Render a scene (glTF, FBX, Collada, OBJ, ...) with helio render",
    settings: [
        { key: "scene", type: "string", subtype: "file_path", required: true,
          description: "Scene file, at a path that all workers have" },
        { key: "render_output", type: "string", subtype: "file_path", required: true,
          description: "Files to write, with #### for the frame: /shots/010/beauty.####.exr" },
        { key: "frames", type: "string", required: true, default: "0-47",
          description: "Frames, such as 0-47 or 1,3,5-9" },
        { key: "chunk_size", type: "int32", default: 4, description: "Frames of a task" },
        { key: "fps", type: "float", default: 24.0, description: "Frames per second" },
        { key: "size", type: "string", default: "1920x1080", description: "Width x height" },
        { key: "mode", type: "string", choices: ["path", "realtime"], default: "path",
          description: "Path traced, or as the viewers show it" },
        { key: "samples", type: "int32", default: 256, description: "Samples per pixel" },
        { key: "noise", type: "float", default: 0.02,
          description: "Path traced: stop at this relative error; 0 = take all samples" },
        { key: "aov", type: "string", default: "",
          description: "Planes of EXR files: albedo,normal,depth,cryptomatte or all" },
        { key: "exposure", type: "string", default: "0",
          description: "In stops. Not auto: every task would meter its own first frame" },
        { key: "strict", type: "bool", default: true,
          description: "Fail when a texture is missing, instead of rendering without it" },
        { key: "options", type: "string", default: "",
          description: "More options of helio render, between blanks: --env=/lib/studio.hdr --camera=Main" },
    ]
};

function compileJob(job) {
    for (const chunk of frameChunker(job.settings.frames, job.settings.chunk_size)) {
        const task = author.Task(`render-${chunk}`, "misc");
        task.addCommand(author.Command("exec", {
            exe: "mkdir", args: ["-p", path.dirname(job.settings.render_output)] }));
        task.addCommand(author.Command("exec", {
            exe: "{helio}", args: renderArguments(job.settings, chunk) }));
        job.addTask(task);
    }
}

function renderArguments(settings, chunk) {
    let args = [
        "render", settings.scene, `--output=${settings.render_output}`,
        `--frames=${chunk}`, `--fps=${settings.fps}`, `--size=${settings.size}`,
        `--mode=${settings.mode}`, `--samples=${settings.samples}`, `--exposure=${settings.exposure}`,
        "--skip-existing",
    ];
    if (settings.mode === "path") {
        args = args.concat(["--resume", "--checkpoint=300"]);
        if (settings.noise > 0) args.push(`--noise=${settings.noise}`);
    }
    if (settings.aov) args.push(`--aov=${settings.aov}`);
    if (settings.strict) args.push("--strict");
    return args.concat((settings.options || "").split(" ").filter((word) => word));
}
