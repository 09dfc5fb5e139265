// The program helio against a fake worker and a fake daemon: exit codes, messages, outputs.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/unit/client/cli_harness.h"

static void test_render(void **state)
{
    (void)state;
    expect_run(0, "warning: fake.gltf: /extensionsUsed/0: unknown ?[31mextension", "log=log",
        "$HELIO render s.gltf -o a.png --size 64x32 --samples 8 --orbit 30,60,5 --env none");
    expect_file("a.png", "frame 1 as PNG8");
    expect_file("log", "view_set size=64x32 samples=8\n");
    expect_file("log", "eye=2.16506,2.5,3.75 camera=0\n");
    expect_file("log", "environment_set kind=NONE\n");
    expect_run(0, NULL, "", "$HELIO render s.gltf -o a.png --bit-depth 16");
    expect_file("a.png", "as PNG16");
    expect_run(0, NULL, "", "$HELIO render s.gltf -o a.JPG --jpeg-quality 50");
    expect_file("a.JPG", "as JPEG");
    expect_run(0, NULL, "", "$HELIO render s.gltf -o a.exr");
    expect_file("a.exr", "as EXR_HALF");
    expect_run(0, NULL, "", "$HELIO render s.gltf -o a.exr --exr float");
    expect_file("a.exr", "as EXR_FLOAT");
}

static void test_default_camera_and_light(void **state)
{
    (void)state;
    expect_run(0, NULL, "log=log1", "$HELIO render s.gltf -o a.png");
    expect_run(1, NULL, "", "grep environment_set log1"); // the server's default light
    expect_run(0, NULL, "log=loge", "$HELIO render s.gltf -o a.png --env sky");
    expect_file("loge", "environment_set kind=SKY\n");
    expect_file("log1", "view_fit cameras=1");
    expect_file("log1", "camera=4294967297\n"); // that the server chose
    expect_run(0, NULL, "log=logs", "$HELIO render s.gltf -o a.png --sun 90,30,4");
    expect_file("logs", "environment_set kind=SKY sun=1 at 0.866,0.5,5.3e-17 turbidity=4\n");
    expect_run(0, NULL, "log=logo", "$HELIO render s.gltf -o a.png --sun off --env sky");
    expect_file("logo", "environment_set kind=SKY sun=0 at 0,0,0 turbidity=0\n");
    expect_run(0, NULL, "log=log2", "$HELIO render s.gltf -o a.png --camera eye");
    expect_file("log2", "camera=4294967297\n");
    expect_run(0, NULL, "log=log3", "$HELIO render s.gltf -o a.png --camera 0");
    expect_file("log3", "camera=4294967297\n");
    expect_run(0, NULL, "log=log4", "$HELIO render s.gltf -o a.png --fov 30");
    expect_file("log4", "view_fit cameras=0 azimuth=0 elevation=0 vfov=0.5236\n");
    expect_file("log4", "eye=0,0,5 camera=0\n");
    expect_run(0, NULL, "log=log6", "$HELIO render s.gltf -o a.png --view left");
    expect_file("log6", "view_fit cameras=0 azimuth=-1.571 elevation=0 vfov=0.7854\n");
    expect_run(
        0, NULL, "log=log7", "$HELIO render s.gltf -o a.png --camera fit --view 10,-20 --fov 90");
    expect_file("log7", "view_fit cameras=0 azimuth=0.1745 elevation=-0.3491 vfov=1.571\n");
    expect_run(2, "--camera: no camera 'nose'; the scene has 0 'eye'", "",
        "$HELIO render s.gltf -o a.png --camera nose");
    expect_run(0, NULL, "log=log5", "$HELIO render demo: -o a.png");
    expect_file("log5", "asset_load path=demo: files=0");
}

static void test_frames(void **state)
{
    (void)state;
    expect_run(0, NULL, "log=logf",
        "$HELIO render s.gltf -o f-####.png --frames 10-20:5 --fps 10 --stats st.json");
    expect_file("f-0010.png", "frame 1 ");
    expect_file("f-0015.png", "frame 2 ");
    expect_file("f-0020.png", "frame 3 ");
    expect_file("logf", "animation_set time=1\n");
    expect_file("logf", "animation_set time=1.5\n");
    // All pictures have the exposure that the first one metered, unless one is asked for.
    expect_file("logf", "exposure_query\n");
    expect_file("logf", "view_set exposure=0,-2.5 ");
    expect_run(0, NULL, "log=logx", "$HELIO render s.gltf -o f-####.exr --frames 1-2");
    expect_run(1, NULL, "", "grep exposure_query logx");
    expect_run(0, NULL, "log=logy", "$HELIO render s.gltf -o f-####.png --frames 1-2 --exposure 3");
    expect_run(1, NULL, "", "grep exposure_query logy");
    expect_run(0, NULL, "", "$HELIO render s.gltf -o g%03d.png --frames 7-7");
    expect_file("g007.png", "frame 1 ");
    expect_run(2, "--output", "", "$HELIO render s.gltf -o g.png --frames 1-2");
    expect_run(0, NULL, "",
        "mkdir -p take#1; $HELIO render s.gltf -o take#1/a#2-###.png --frames 3-4 && "
        "$HELIO render s.gltf -o take#1/5%-%02d.png --frames 6-7");
    expect_file("take#1/a#2-004.png", "frame 2 ");
    expect_file("take#1/5%-07.png", "frame 2 ");
    expect_run(2, "--output: the file's name needs ####", "",
        "$HELIO render s.gltf -o take#1/a.png --frames 3-4");
    expect_run(0, NULL, "log=logt", "$HELIO render s.gltf -o a.png --at 2.5");
    expect_file("logt", "animation_set time=2.5\n");
}

static void test_frame_lists(void **state)
{
    (void)state;
    expect_run(0, NULL, "animations=1 log=logn",
        "$HELIO render s.gltf -o n-##.png --frames 4,-2,6-8x2,4 --fps 2 2>said; cat said");
    expect_file("n-04.png", "frame 1 ");
    expect_file("n--2.png", "frame 2 ");
    expect_file("n-06.png", "frame 3 ");
    expect_file("n-08.png", "frame 4 ");
    expect_file("logn", "animation_set time=-1\n");
    expect_run(2, "--frames: '1,x': character 3: a frame number is expected", "",
        "$HELIO render s.gltf -o n-##.png --frames 1,x");
    expect_run(2, "have to ascend", "",
        "$HELIO render s.gltf -o n-##.png --frames 3-1 --mode path --denoise");
    // The scene of the test moves; of the other one all frames are the same.
    harness_read(&h, "said");
    assert_null(strstr(h.output, "nothing moves"));
    expect_run(
        0, "nothing moves in these 3 frames", "", "$HELIO render s.gltf -o n-##.png --frames 1-3");
}

static void test_turntable(void **state)
{
    (void)state;
    expect_run(0, NULL, "log=logy",
        "$HELIO render s.gltf -o y-%02d.png --turntable 4 --orbit 0,90,2 2>said; cat said");
    expect_file("y-00.png", "frame 1 ");
    expect_file("y-03.png", "frame 4 ");
    expect_no_file("y-04.png");
    expect_file("logy", "eye=0,1.22465e-16,2 camera=0\n");
    expect_file("logy", "eye=2,");
    expect_file("logy", "eye=-2,");
    harness_read(&h, "said");
    assert_null(strstr(h.output, "nothing moves"));
    // Some of its frames, for other machines; a pose that stays.
    expect_run(0, NULL, "log=logz",
        "$HELIO render s.gltf -o z-#.png --turntable 4 --frames 1,3 --at 2 --orbit 0,90,2");
    expect_no_file("z-0.png");
    expect_file("z-3.png", "frame 2 ");
    expect_file("logz", "animation_set time=2\n");
    expect_run(2, "--turntable: needs a view with a target", "",
        "$HELIO render s.gltf -o z-#.png --turntable 4 --camera eye");
    expect_run(2, "--output: the file's name needs ####", "",
        "$HELIO render s.gltf -o z.png --turntable 4");
}

static void test_quality(void **state)
{
    (void)state;
    expect_run(0, "helio: --quality draft: --samples 2 --error-px 4", "log=logd",
        "$HELIO render s.gltf -o a.png --quality draft");
    expect_file("logd", "samples=2\n");
    expect_run(0, "helio: --quality draft: --error-px 2 --max-bounces 4", "log=loge",
        "$HELIO render s.gltf -o a.png --quality draft --mode path --spp 3");
    expect_file("loge", "samples=3\n");
    expect_run(0, "--samples 1024 --error-px 1 --noise 0.01", "",
        "$HELIO render s.gltf -o a.png --quality final --mode path");
    expect_run(2, "of JPEG files it is --jpeg-quality 80", "",
        "$HELIO render s.gltf -o a.jpg --quality 80");
}

static void test_region(void **state)
{
    (void)state;
    expect_run(0, NULL, "log=logg",
        "$HELIO render s.gltf -o a.png --size 64x32 --region 8,4,16,28 "
        "--stats r.json");
    expect_file("logg", "region=8,4,16,28 size=64x32");
    expect_file("r.json", "\"region\"");
    expect_run(0, "wrote a.png (16 x 28) in", "",
        "$HELIO render s.gltf -o a.png --size 64x32 --region 8,4,16,28");
    expect_run(2, "--region: is not inside of the picture of 64x32 px", "",
        "$HELIO render s.gltf -o a.png --size 64x32 --region 8,5,16,28");
}

// Changed in place, replaced by renaming, gone for a while, and an image beside it; then Ctrl-C.
static void test_watch(void **state)
{
    (void)state;
    expect_run(0, "all seen, exit 0", "log=logw",
        "mkdir -p w; cp s.gltf w/s.gltf; echo a >w/e.hdr; : >logw; : >said; "
        "count() { grep -c \"$1\" said; }; before=0; "
        "until_seen() { n=0; until [ $(count \"$1\") -gt $before ] || [ $n = 400 ]; do "
        "sleep 0.05; n=$((n+1)); done; before=$(count watching); }; "
        "$HELIO render w/s.gltf -o w/a.png --env w/e.hdr --watch 2>said & p=$!; "
        "until_seen watching; cat s.gltf >w/s.gltf; "
        "until_seen watching; cp s.gltf w/new; mv w/new w/s.gltf; "
        "until_seen watching; rm w/s.gltf; echo b >w/e.hdr; before=0; "
        "until_seen 'cannot open'; cp s.gltf w/s.gltf; "
        "until_seen watching; : >w/other.hdr; echo c >w/e.hdr; "
        "until_seen watching; sleep 1; kill -INT $p; wait $p; code=$?; "
        "[ $(grep -c asset_load logw) -ge 5 ] && [ $(count watching) -ge 6 ] && "
        "echo all seen, exit $code");
    expect_file("w/a.png", "frame 1 as PNG8");
    expect_run(2, "--watch: has no file to watch", "", "$HELIO render demo: -o a.png --watch");
    expect_run(2, "--watch: needs files of this machine", "",
        "$HELIO render s.gltf -o a.png --watch --connect unix:nowhere");
    expect_run(2, "--spp", "", "$HELIO render s.gltf -o a.png --watch --spp 0");
    expect_run(2, "--target", "", "$HELIO render s.gltf -o a.png --watch --target 0,0,0");
}

static void test_path(void **state)
{
    (void)state;
    expect_run(0, NULL, "log=logp",
        "$HELIO render s.gltf -o p.exr --mode path --trace compute --max-bounces 4 --noise 0.25 "
        "--time 2 --aov depth,Direct,crypto_asset");
    // trace 2; bits of depth, the three direct ones, crypto_asset
    expect_file("logp", "view_set mode=1 trace=2 bounces=4 noise=0.25 time=2 planes=200390 size");
    expect_run(0, NULL, "log=logq", "$HELIO render s.gltf -o p.exr --mode path --aov all");
    expect_file("logq", "planes=3bfffe");
    // in real time without what only light that was followed knows
    expect_run(0, NULL, "log=logr", "$HELIO render s.gltf -o p.exr --mode realtime --aov all");
    expect_file("logr", "planes=39e07e");
    expect_run(9, "as the test wants", "fail=view_set:7",
        "$HELIO render s.gltf -o p.exr --mode path --trace khr");
    expect_run(9, "as the test wants", "fail=view_set:19",
        "$HELIO render s.gltf -o p.exr --mode path --trace khr");
}

static void test_lens(void **state)
{
    (void)state;
    expect_run(0, NULL, "log=logl",
        "$HELIO render s.gltf -o p.exr --mode path --eye 1,2,3 --lens-radius 0.25 --focus 4 "
        "--filter tent --filter-radius 2.5 --clamp-indirect 8");
    expect_file("logl", "filter=2,2.5 clamp=8 size");
    expect_file("logl", "view_camera eye=1,2,3 camera=0 lens=0.25,4\n");
    expect_run(2, "as the test wants", "fail=view_camera:1",
        "$HELIO render s.gltf -o p.exr --mode path --lens-radius 0.25");
}

static void test_catchers(void **state)
{
    (void)state;
    expect_run(0, NULL, "animations=1 log=logn",
        "$HELIO render s.gltf -o p.exr --mode path --catcher 1:7 --catcher 1:9");
    expect_file("logn", "node_set node=4294967303 catches=1\n");
    expect_file("logn", "node_set node=4294967305 catches=1\n");
}

// What does not fit a message comes and goes in parts.
static void test_parts(void **state)
{
    (void)state;
    expect_run(0, NULL, "parts=1", "$HELIO render s.gltf -o q.png --stats q.json");
    expect_file("q.png", "frame 1 ");
    expect_run(0, NULL, "", "$HELIO render s.gltf -o whole.png --stats whole.json");
    expect_run(0, NULL, "", "cmp q.png whole.png");
    expect_run(7, "parts do not fit together", "parts=gap", "$HELIO render s.gltf -o gap.png");
    expect_no_file("gap.png");
    expect_run(0, NULL, "", "$HELIO render s.gltf -o big.png --skip-existing");
    expect_run(0, NULL, "", "head -c 20000000 /dev/zero >big.png; echo >>big.png");
    expect_run(
        0, NULL, "log=logb", "$HELIO render s.gltf -o big.png --skip-existing --stats big.json");
    expect_file(
        "logb", "image_query part=0 size=20000001\nimage_query part=16777216 size=20000001\n");
    expect_file("big.json", "\"skipped_frames\": 1");
}

// Files that are whole and of this job are left alone; others are made again, and said why.
static void test_skip_existing(void **state)
{
    (void)state;
    static const char command[] =
        "$HELIO render s.gltf -o k-##.png --frames 1-3 --skip-existing --stats k.json";
    expect_run(0, NULL, "", command);
    expect_file("k-03.png", "frame 3 ");
    expect_run(0, NULL, "", command);
    expect_file("k-03.png", "frame 3 ");
    expect_file("k.json", "\"skipped_frames\": 3");
    harness_write(&h, "k-02.png", "frame 2", 7);
    expect_run(0, "k-02.png: cut short; it is made again", "log=logk", command);
    expect_file("k-02.png", "frame 1 ");
    expect_file("k-03.png", "frame 3 ");
    expect_file("logk", "image_query\n");
    expect_run(0, "k-01.png: was made from something else; it is made again", "job=2", command);
    expect_file("k-01.png", "frame 1 ");
    expect_file("k-03.png", "frame 3 as");
    expect_run(7, NULL, "die=image_query", command);
}

static void test_checkpoints(void **state)
{
    (void)state;
    static const char stop[] =
        "rm -f logc; $HELIO render s.gltf -o cp.png --mode path & p=$!; "
        "until grep -qs frame_request logc; do sleep 0.05; kill -0 $p || break; done; "
        "kill -TERM $p; wait $p";
    static const char resume[] = "$HELIO render s.gltf -o cp.png --mode path --resume";
    expect_run(8, "the same command with --resume", "silent=frame_request log=logc", stop);
    expect_no_file("cp.png");
    expect_file("cp.png.checkpoint", "HGCK");
    expect_run(0, "is of another picture", "job=3 log=logd", resume);
    expect_run(8, NULL, "silent=frame_request log=logc", stop);
    expect_run(0, "goes on from 16 samples", "log=loge", resume);
    expect_file("loge", "checkpoint_set film\n");
    expect_file("cp.png", "frame 1 ");
    expect_no_file("cp.png.checkpoint"); // it has done its duty
    expect_run(0, NULL, "", resume);     // and is not needed
    // Cut short and damaged ones, in intervals, and none at all.
    expect_run(8, NULL, "silent=frame_request log=logc", stop);
    expect_run(0, "is cut short", "",
        "head -c 94 cp.png.checkpoint >t && mv t cp.png.checkpoint; "
        "$HELIO render s.gltf -o cp.png --mode path --resume");
    expect_run(8, NULL, "silent=frame_request log=logc", stop);
    expect_run(0, "is damaged", "",
        "sed -i s/film/firm/ cp.png.checkpoint; "
        "$HELIO render s.gltf -o cp.png --mode path --resume");
    expect_run(8, NULL, "silent=frame_request fail=checkpoint_query:12 log=logc", stop);
    expect_no_file("cp.png.checkpoint");
    expect_run(0, "as the test wants; the film starts at sample 0", "fail=checkpoint_set:1",
        "FAKE=\"silent=frame_request log=logc\"; rm -f logc; $HELIO render s.gltf -o cp.png --mode "
        "path & p=$!; until grep -qs frame_request logc; do sleep 0.05; done; kill -TERM $p; "
        "wait $p; FAKE=fail=checkpoint_set:1; $HELIO render s.gltf -o cp.png --mode path --resume");
    expect_run(7, NULL, "silent=frame_request log=logi",
        "$HELIO render s.gltf -o v.png --mode path --checkpoint 1 --timeout 3");
    expect_file("v.png.checkpoint", "HGCK");
    // A disk that takes none does not end the rendering.
    expect_run(7,
        "w.png.checkpoint: cannot rename into place: Is a directory; the rendering goes on",
        "silent=frame_request", // which ends by the limit of time
        "mkdir w.png.checkpoint; $HELIO render s.gltf -o w.png --mode path --checkpoint 1 "
        "--timeout 3");
    assert_non_null(strstr(h.output, "no answer"));
}

static void test_stats(void **state)
{
    (void)state;
    expect_run(0, NULL, "", "$HELIO render s.gltf -o a.png --stats st.json");
    assert_true(harness_read(&h, "st.json"));
    json_t *stats = json_loads(h.output, 0, NULL);
    assert_non_null(stats);
    json_t *frame = json_object_get(stats, "frame"), *client = json_object_get(stats, "client");
    assert_string_equal(
        json_string_value(json_object_get(json_object_get(stats, "device"), "name")), "fake");
    assert_true(json_real_value(json_object_get(frame, "render_ms")) == 1.5);
    assert_int_equal(json_integer_value(json_object_get(frame, "samples")), 32);
    assert_true(json_is_number(json_object_get(client, "total_ms")));
    assert_true(json_is_number(json_object_get(client, "load_ms")));
    assert_int_equal(json_array_size(json_object_get(stats, "frames")), 1);
    json_decref(stats);
    // Names of files are bytes.
    expect_run(0, NULL, "", "$HELIO render s.gltf -o \"$(printf 'b\\344r.png')\" --stats st.json");
    expect_file("b\344r.png", "frame 1 ");
    expect_file("st.json", "\"b?r.png\"");
}

// What reads JSON gets nothing else, also of a command line that is wrong.
static void test_usage_json(void **state)
{
    (void)state;
    expect_run(
        2, "{\"event\":\"error\"", "", "$HELIO render s.gltf -o a.png --sise 3 --progress json");
    expect_run(2, "\"event\":\"end\",", "", "$HELIO rendr --progress=json");
    assert_int_equal(h.output[0], '{');
    expect_run(2, "helio: rendr: unknown", "", "$HELIO rendr --progress json --progress none");
    expect_run(0, "usage: helio render SCENE", "", "$HELIO help render");
    expect_run(
        0, "", "", "$HELIO help render | grep -q '|motion|history'"); // in full, however long
    expect_run(2, "did you mean helio --version?", "", "$HELIO --verison");
    expect_run(0, "wrote", "", "$HELIO render s.gltf -o up.png --up z --background Teal");
}

static void test_usage(void **state)
{
    (void)state;
    static const char *const bad[][2] = {{"", "needs a command"}, {"fly", "unknown command"},
        {"look s.gltf", "unknown command"}, {"render", "SCENE"}, {"render s.gltf", "--output"},
        {"render s.gltf -o a.bmp", ".png"},
        {"render s.gltf -o a.exr --aov depth,direct-diffuse",
            "--aov: 'direct-diffuse' needs mode path"},
        {"render s.gltf -o a.exr --aov indirect", "'indirect' needs mode path"},
        {"render s.gltf -o a.exr --aov variance", "'variance' needs mode path"},
        {"render s.gltf -o a.exr --aov light-groups", "'light-groups' needs mode path"},
        {"render s.gltf -o a.png --next-eye 1,2,3 --eye 1,1,1", "--next-eye: needs --mode path"},
        {"render s.gltf -o a.exr --aov depth --debug-view lod",
            "--aov: a debug view has no planes"},
        {"render s.gltf -o a.png --mode path --aov depth", "--aov: needs a file that ends in .exr"},
        {"render s.gltf -o a.exr --mode path --aov depht",
            "'depht' is none of: albedo normal geometric-normal depth"},
        {"render s.gltf -o a.exr --mode path --aov depht-of-all-that-the-camera-sees-there",
            " direct indirect cryptomatte all; or a part such as direct-diffuse, crypto-object"},
        {"render s.gltf -o a.exr --mode path --aov depth,", "'' is none of"},
        {"render s.gltf -o a.png --noise 0.1", "--noise: needs --mode path"},
        {"render s.gltf -o a.png --lens-radius 0.1", "--lens-radius: needs --mode path"},
        {"render s.gltf -o a.png --clamp-indirect 1", "--clamp-indirect: needs --mode path"},
        {"render s.gltf -o a.png --filter box", "--filter: needs --mode path"},
        {"render s.gltf -o a.png --mode path --filter sinc", "'sinc' is none of blackman-harris"},
        {"render s.gltf -o a.png --mode path --focus 2", "--focus: needs --lens-radius"},
        {"render s.gltf -o a.png --trace embree", "--trace: needs --mode path"},
        {"render s.gltf -o a.png --mode realtime --resume", "--resume: needs --mode path"},
        {"render s.gltf -o a.png --checkpoint 5", "--checkpoint: needs --mode path"},
        {"render s.gltf -o a.png --time 0", "--at S poses the animations"},
        {"render s.gltf -o a.png --orbit 1,2,3 --eye 1,2,3", "--orbit"},
        {"render s.gltf -o a.png --background '#ff'", "'#ff' is not env, none, blur, #rrggbb"},
        {"render s.gltf -o a.png --background '#12345g'", "--background"},
        {"render s.gltf -o a.png --background 1,-1,1", "--background"},
        {"render s.gltf -o a.png --sun 10", "--sun: '10' is not off, AZIMUTH,ELEVATION"},
        {"render s.gltf -o a.png --sun 10,91", "--sun: '10,91': elevation"},
        {"render s.gltf -o a.png --sun 10,20,0.5", "turbidity 1 to 10"},
        {"render s.gltf -o a.png --sun 10,20 --env none", "--sun: is of the built-in sky"},
        {"render s.gltf -o a.png --sun off --env s.hdr", "--sun: is of the built-in sky"},
        {"render s.gltf -o a.png --camera x --fov 30", "--camera"},
        {"render s.gltf -o a.png --camera fit --target 1,2,3", "--camera"},
        {"render s.gltf -o a.png --view iso --orbit 1,2,3", "--view: cannot be combined"},
        {"render s.gltf -o a.png --view iso --camera 0", "--view: cannot be combined"},
        {"render s.gltf -o a.png --view up", "'up' is none of front back left right"},
        {"render s.gltf -o a.png --view 10,95", "--view: 95 is outside -90 to 90"},
        {"render s.gltf -o a.png --target 1,2,3", "--target"},
        {"render s.gltf -o a.png --eye 1,2,3 --target 1,2,3", "--eye"},
        {"render s.gltf -o a.png --fps 3", "--fps"},
        {"render s.gltf -o a.png --upload", "--upload"},
        {"render s.gltf -o a.png --exr half", "--exr"},
        {"render s.gltf -o a.png --jpeg-quality 3", "--jpeg-quality"},
        {"render s.gltf -o a.####.png", "--output: # or %04d in the file's name"},
        {"render s.gltf -o 'a.%04d.png' --at 1", "it needs --frames or --turntable"},
        {"render s.gltf -o a.jpg --background none", "--background: none is transparent"},
        {"render s.gltf -o jpg:- --background none", "--background: none is transparent"},
        {"render s.gltf -o nowhere/a.png", "nowhere"}, {"render s.gltf -o .", "-o"},
        {"render s.gltf -o a.png --samples 3 --spp 4", "--spp"},
        {"render s.gltf -o a.png --frames 1-2 --at 3", "--at"},
        {"render s.gltf -o a.png --connect ftp:x", "unix:PATH"},
        {"render s.gltf -o a.png --connect tcp:x", "tcp:HOST:PORT"},
        {"render s.gltf -o a.png --connect unix:sock --device 0", "--device"},
        {"render s.gltf -o a.png --connect unix:sock --texture-budget 10", "--texture-budget"},
        {"render s.gltf -o a.png --asset-root nowhere", "nowhere"},
        {"compare s.gltf s.gltf --fail-below x", "--fail-below"}, {"bake s.gltf", "--output"},
        {"bake s.gltf -o s.gltf", "is not a folder"},
        {"bake s.gltf -o d --textures-only --geometry-only", "--textures-only"},
        {"ping", "--connect"}, {"bench realtime --options x", "--options"},
        {"run s.hs --define =x", "--define"}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        char command[256];
        snprintf(command, sizeof command, "$HELIO %s", bad[i][0]);
        expect_run(2, strcmp(bad[i][1], "-o") == 0 ? NULL : bad[i][1], "", command);
    }
    expect_no_file("a.bmp");
    // What is written takes the place of nothing else.
    static const char *const same[][2] = {
        {"-o e.exr --env e.exr", "--output: is the file of --env"},
        {"-o ./e.exr --env sub/../e.exr", "--output: is the file of --env"},
        {"-o new.png --stats new.png", "--stats: is the file of --output"},
        {"-o e.exr --stats ./e.exr", "--stats: is the file of --output"},
        {"-o a.png --stats s.gltf", "--stats: is a file that is read"}};
    harness_write(&h, "e.exr", "sky", 3);
    assert_int_equal(harness_run(&h, "mkdir -p sub"), 0);
    for (size_t i = 0; i < sizeof same / sizeof *same; i++) {
        char command[256];
        snprintf(command, sizeof command, "$HELIO render s.gltf %s", same[i][0]);
        expect_run(2, same[i][1], "", command);
    }
    expect_file("e.exr", "sky");
}

// Seconds: only what never gets an answer is not waited for.
static int patience(const char *fake)
{
    return strcmp(fake, "silent=hello") == 0 || strcmp(fake, "raw=00") == 0 ? 1 : 60;
}

static void test_exit_codes_worker(void **state)
{
    (void)state;
    static const struct {
        const char *fake;
        int code;
        const char *text;
    } rows[] = {
        {"fail=asset_load:6", 3, "fake.gltf: /meshes/0: as the test wants"},
        {"fail=asset_load:7", 3, NULL},
        {"fail=asset_load:8", 3, NULL},
        {"fail=asset_load:10", 3, "--asset-root"}, // refused at a place in the file
        {"fail=asset_load:3", 3, NULL},
        {"fail=asset_load:2", 6, NULL},
        {"fail=environment_set:6", 3, NULL},
        {"fail=view_set:1", 2, NULL},
        {"fail=view_set:7", 9, NULL},
        {"fail=view_set:3", 6, NULL},
        {"fail=frame_request:19", 9, NULL},
        {"fail=frame_request:20", 7, NULL},
        {"fail=frame_request:24", 7, NULL},
        {"fail=frame_request:5", 6, NULL},
        {"fail=frame_request:3", 6, NULL},
        {"die=asset_load", 7, "the private worker was killed by signal 9"},
        {"die=frame_request", 7, "the private worker was killed by signal 9"},
        {"half=frame_request", 7, "the private worker was killed by signal 9"},
        {"half=asset_load", 7, "the private worker"},
        {"raw=00", 7, NULL},
        {"raw=ffffffff050500000000000001000000", 7, "size limit"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char command[128];
        snprintf(command, sizeof command, "$HELIO render s.gltf -o b.png --env none --timeout %d",
            patience(rows[i].fake));
        harness_write(&h, "b.png", "before", 6);
        expect_run(rows[i].code, rows[i].text, rows[i].fake, command);
        expect_file("b.png", "before"); // an older output is untouched
    }
    expect_run(3, "gone.gltf", "", "$HELIO render gone.gltf -o c.png");
    expect_run(3, "gone.hdr", "", "$HELIO render s.gltf -o c.png --env gone.hdr");
    expect_run(9, "cannot start", "", "HELIO_WORKER=/nonexistent $HELIO render s.gltf -o c.png");
    expect_run(7, "exit code 0", "", "HELIO_WORKER=/bin/true $HELIO render s.gltf -o c.png");
    expect_no_file("c.png");
}

// A warning of the scene, of the picture, or of a bake: nothing is written.
static void test_strict(void **state)
{
    (void)state;
    expect_run(0, "warning: fake.gltf", "", "$HELIO render s.gltf -o w.png");
    expect_run(3, "1 warning, which --strict does not take", "",
        "$HELIO render s.gltf -o strict.png --strict");
    expect_run(0, NULL, "quiet=1", "$HELIO render s.gltf -o w.png --strict");
    expect_run(3, "warning: fake.gltf: an image was lost", "quiet=1 lost=2",
        "$HELIO render s.gltf -o strict-#.png --frames 1-3 --strict");
    expect_file("strict-1.png", "frame 1 ");
    expect_no_file("strict-2.png");
    expect_no_file("strict.png");
    expect_run(3, "which --strict does not take", "", "$HELIO bake s.gltf -o strict-bake --strict");
    expect_run(0, "\"packs\"", "quiet=1", "$HELIO bake s.gltf -o strict-bake --strict");
}

static void test_exit_codes_daemon(void **state)
{
    (void)state;
    static const struct {
        const char *fake;
        int code;
        const char *text;
    } rows[] = {
        {"", 0, NULL},
        {"dribble=1", 0, NULL},
        {"stray=1", 0, NULL},
        {"dribble=1 stray=1", 0, NULL},
        {"token=secret", 5, "token"},
        {"version=77", 4, "version 77"},
        {"die=hello", 4, NULL},
        {"die=frame_request", 4, "closed the connection"},
        {"half=frame_request", 4, "in the middle of a message"},
        {"fail=scene_open:23", 6, NULL},
        {"fail=scene_open:10", 5, NULL},
        {"fail=frame_request:21", 7, NULL},
        {"fail=frame_request:18", 4, NULL}, // it ended before the frame was done
        {"silent=hello", 4, NULL},
        {"raw=ffffffff010100000000000000000000", 4, "size limit"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char command[128];
        snprintf(command, sizeof command,
            "$HELIO render any.gltf -o d.png --connect unix:sock --timeout %d",
            patience(rows[i].fake));
        harness_serve(&h, rows[i].fake);
        expect_run(rows[i].code, rows[i].text, "", command);
    }
    harness_serve(&h, "token=secret");
    expect_run(5, "unknown token", "", "$HELIO ping --connect unix:sock --token wrong");
    expect_run(0, "fake/1", "", "$HELIO ping --count 2 --connect unix:sock --token secret");
    expect_run(0, NULL, "", "HELIO_TOKEN=secret $HELIO ping --count 1 --connect unix:sock");
    harness_write(&h, "token", "secret\n", 7);
    expect_run(0, NULL, "", "$HELIO ping --count 1 --connect unix:sock --token-file token");
    expect_run(2, "gone", "", "$HELIO ping --connect unix:sock --token-file gone");
    expect_run(4, "cannot connect", "", "$HELIO ping --connect unix:nobody");
    expect_run(4, "cannot connect", "", "$HELIO ping --connect tcp:127.0.0.1:1");
    expect_run(4, "cannot find the host", "", // a name that no server is asked for
        "$HELIO ping --connect tcp:no..such.host.invalid:1");
}

static void test_other_commands(void **state)
{
    (void)state;
    harness_serve(&h, "");
    expect_run(0, "\"name\": \"fake\"", "", "$HELIO stats --connect unix:sock");
    expect_run(0, "id  name", "", "$HELIO sessions --connect unix:sock");
    expect_run(0, "\"sessions\"", "", "$HELIO sessions --json --connect unix:sock");
    expect_run(0, "\"packs\": 2", "", "$HELIO bake s.gltf -o baked");
    expect_run(0, NULL, "", "$HELIO bake s.gltf -o baked --stats baked/report.json");
    expect_run(3, "not baked: a.png: broken", "unbaked=1", "$HELIO bake s.gltf -o baked");
    expect_run(3, "/meshes/0", "fail=asset_load:6", "$HELIO bake s.gltf -o baked");
    expect_run(6, NULL, "fail=bake:5", "$HELIO bake s.gltf -o baked");
    expect_run(7, "the private worker was killed by signal 9", "die=bake",
        "$HELIO bake s.gltf -o baked --timeout 60");
    expect_run(0, "nodes", "", "$HELIO info s.gltf");
    expect_run(0, "\"counts\"", "", "$HELIO info s.gltf --json");
    expect_run(3, "gone.gltf", "", "$HELIO info gone.gltf");
    expect_run(3, "/meshes/0", "fail=asset_load:6", "$HELIO info s.gltf");
    expect_run(0, "psnr 999", "", "$HELIO compare s.gltf s.gltf --fail-below 40");
    expect_run(1, "20 is below 40", "", "$HELIO compare s.gltf t.txt --fail-below 40 --diff x.png");
    expect_file("x.png", "diff");
    expect_run(1, "ssim 20", "", "$HELIO compare s.gltf t.txt --metric ssim --fail-above 1");
    expect_run(0, "psnr 20\nflip 20\n", "", "$HELIO compare s.gltf t.txt --metric psnr,flip");
    expect_run(0, "rmse 20\nmax 20\n", "", "$HELIO compare s.gltf t.txt --metric all");
    expect_run(1, "flip 20 is above 3", "",
        "$HELIO compare s.gltf t.txt --metric psnr,flip --fail-below psnr=9 --fail-above flip=3");
    expect_run(
        2, "name the metric", "", "$HELIO compare s.gltf t.txt --metric psnr,flip --fail-below 9");
    expect_run(2, "names no metric that is measured", "",
        "$HELIO compare s.gltf t.txt --fail-below flip=9");
    expect_run(2, "'depth' is none of psnr", "", "$HELIO compare s.gltf t.txt --metric depth");
    expect_run(3, "gone.png", "", "$HELIO compare s.gltf t.txt --mask gone.png");
    expect_run(3, "gone.png", "", "$HELIO compare s.gltf gone.png");
    expect_run(3, NULL, "fail=compare:6", "$HELIO compare s.gltf t.txt");
    expect_run(0, "usage: helio render", "", "$HELIO render --help");
    expect_run(0, "exit codes:", "", "$HELIO --help");
    expect_run(0, "helio ", "", "$HELIO --version");
    expect_run(0, "\"stage\":\"samples\",\"done\":16", "",
        "$HELIO render s.gltf -o a.png --progress json");
}

static void test_upload(void **state)
{
    (void)state;
    static const char gltf[] =
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"uri\":\"a%20b.bin\"}],"
        "\"images\":[{\"uri\":\"sub/t.png\"},{\"uri\":\"data:,x\"}]}";
    harness_write(&h, "u.gltf", gltf, sizeof gltf - 1);
    harness_write(&h, "a b.bin", "binary", 6);
    assert_int_equal(harness_run(&h, "mkdir -p sub && head -c 3000000 /dev/zero > sub/t.png"), 0);
    harness_serve(&h, "log=logu");
    expect_run(0, NULL, "", "$HELIO render u.gltf --upload --connect unix:sock -o a.png");
    expect_file("logu", "upload total=6\n");
    expect_file("logu", "upload total=3000000\nupload total=3000000\nupload total=3000000\n");
    expect_file("logu", "asset_load path= files=3\n");
    harness_serve(&h, "have=1 log=logv");
    expect_run(0, NULL, "", "$HELIO render u.gltf --upload --connect unix:sock -o a.png");
    expect_file("logv", "asset_load path= files=3\n");
    assert_null(strstr(h.output, "upload total"));
    assert_int_equal(harness_run(&h, "rm sub/t.png"), 0);
    expect_run(3, "sub/t.png", "", "$HELIO render u.gltf --upload --connect unix:sock -o a.png");
}

// As soon as the frame is asked for.
static void test_interrupt(void **state)
{
    (void)state;
    static const char *const signals[] = {"INT", "TERM", "HUP"};
    for (int i = 0; i < 3; i++) {
        char command[300];
        snprintf(command, sizeof command,
            "rm -f logi; $HELIO render s.gltf -o i.png --timeout 100 & p=$!; "
            "until grep -qs frame_request logi; do sleep 0.05; kill -0 $p || break; done; "
            "kill -%s $p; wait $p",
            signals[i]);
        expect_run(8, "interrupted", "silent=frame_request log=logi", command);
    }
    expect_no_file("i.png");
    // nohup; and output that is not read
    expect_run(0, NULL, "log=logh",
        "rm -f logh; trap '' HUP; $HELIO render s.gltf -o i-##.png --frames 1-400 & p=$!; "
        "until grep -qs frame_request logh; do sleep 0.05; kill -0 $p || break; done; "
        "kill -HUP $p; wait $p");
    expect_file("i-400.png", "frame 400 ");
    expect_run(0, NULL, "",
        "mkfifo said; { head -c 1 said >/dev/null; } & "
        "{ $HELIO render s.gltf -o j-##.png --frames 1-9 --progress json; echo $? >code; } 2>said; "
        "wait; exit $(cat code)");
    expect_file("j-09.png", "frame 9 ");
    expect_run(0, NULL, "", "$HELIO render s.gltf -o l.png --progress json <&- 2>&-");
    expect_file("l.png", "frame 1 ");
}

static void test_output_failures(void **state)
{
    (void)state;
    bool limits = harness_run(&h, "test -w /dev/full") == 0;
#ifdef __SANITIZE_THREAD__
    limits = false; // its start-up writes a file of its own and dies of the limit
#endif
    if (limits)
        expect_run(6, NULL, "",
            "mkdir -p ro; ulimit -f 0; trap '' XFSZ; $HELIO render s.gltf -o full.png");
    expect_no_file("full.png");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_render),
        cmocka_unit_test(test_default_camera_and_light),
        cmocka_unit_test(test_frames),
        cmocka_unit_test(test_frame_lists),
        cmocka_unit_test(test_turntable),
        cmocka_unit_test(test_quality),
        cmocka_unit_test(test_watch),
        cmocka_unit_test(test_region),
        cmocka_unit_test(test_usage_json),
        cmocka_unit_test(test_path),
        cmocka_unit_test(test_lens),
        cmocka_unit_test(test_parts),
        cmocka_unit_test(test_catchers),
        cmocka_unit_test(test_skip_existing),
        cmocka_unit_test(test_checkpoints),
        cmocka_unit_test(test_stats),
        cmocka_unit_test(test_usage),
        cmocka_unit_test(test_exit_codes_worker),
        cmocka_unit_test(test_strict),
        cmocka_unit_test(test_exit_codes_daemon),
        cmocka_unit_test(test_other_commands),
        cmocka_unit_test(test_upload),
        cmocka_unit_test(test_interrupt),
        cmocka_unit_test(test_output_failures),
    };
    return cmocka_run_group_tests(tests, cli_setup, cli_teardown);
}
