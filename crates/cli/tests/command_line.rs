//! The program as its user meets it: exit codes, messages, files left behind.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::fs;
use std::path::Path;

use program::{espalier, stderr};
use tempfile::TempDir;

/// A folder with one file in it.
fn folder_with(name: &str, bytes: &[u8]) -> TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    fs::write(folder.path().join(name), bytes).expect("write");
    folder
}

/// Runs the program on a bad input and checks its code, its message, and that nothing but the input is there.
#[track_caller]
fn refused(folder: &TempDir, arguments: &[&str], exit_code: i32, fragments: &[&str]) {
    let before = listing(folder.path());
    let output = espalier(folder.path(), arguments);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(exit_code), "{text}");
    for fragment in fragments {
        assert!(text.contains(fragment), "no {fragment:?} in: {text}");
    }
    assert!(!text.contains("panicked"), "{text}");
    // Why a run stopped is noted in a folder that is there; nothing else is new.
    let is_new = |file: &String| !before.contains(file) && !file.ends_with("/provenance/failure.json");
    let left: Vec<String> = listing(folder.path()).into_iter().filter(is_new).collect();
    assert_eq!(left, Vec::<String>::new(), "left behind");
}

fn listing(folder: &Path) -> Vec<String> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("folder") {
            let path = entry.expect("entry").path();
            if path.is_dir() { folders.push(path) } else { files.push(path.display().to_string()) }
        }
    }
    files.sort();
    files
}

/// A gzipped NIfTI-1 file of 8³ voxels, all of this value.
fn uniform_volume(value: bool) -> Vec<u8> {
    let grid =
        espalier_model::Grid::axis_aligned([8, 8, 8], glam::DVec3::ONE, glam::DVec3::ZERO).expect("grid");
    espalier_model::nifti_out::mask(&espalier_model::Mask::from_voxels(grid, &[value; 512])).expect("bytes")
}

#[test]
fn help_teaches_and_succeeds() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let output = espalier(folder.path(), &["--help"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(0));
    for command in [
        "run",
        "compare",
        "juxtapose",
        "sweep",
        "phantom",
        "volume",
        "skeleton",
        "radius",
        "tree",
        "views",
        "embed",
        "render",
        "verify",
        "profile",
        "locate",
    ] {
        assert!(text.contains(&format!("\n  {command} ")), "no {command} in: {text}");
    }
    assert!(text.contains("Exit codes:"));
}

#[test]
fn missing_file() {
    let folder = tempfile::tempdir().expect("temporary folder");
    refused(&folder, &["run", "nowhere.nii.gz"], 74, &["nowhere.nii.gz", "hint"]);
    assert!(listing(folder.path()).is_empty());
    refused(&folder, &["run", "nowhere.toml"], 74, &["error[E-IO-READ]", "nowhere.toml"]);
}

#[test]
fn directory_as_input() {
    let folder = tempfile::tempdir().expect("temporary folder");
    fs::create_dir(folder.path().join("scan.nii.gz")).expect("folder");
    // A folder is a DICOM series; this one holds none.
    refused(&folder, &["run", "scan.nii.gz"], 3, &["scan.nii.gz", "no DICOM image"]);
}

#[test]
fn truncated_gzip() {
    let whole = uniform_volume(true);
    let folder = folder_with("cut.nii.gz", &whole[..whole.len() / 2]);
    refused(
        &folder,
        &["run", "cut.nii.gz"],
        3,
        &["cut.nii.gz", "error[E-VOLUME-TRUNCATED]", "nothing was written"],
    );
}

#[test]
fn empty_mask() {
    let folder = folder_with("empty.nii.gz", &uniform_volume(false));
    refused(&folder, &["run", "empty.nii.gz"], 3, &["error[E-VOLUME", "empty.nii.gz", "hint"]);
}

#[test]
fn swc_with_a_cycle() {
    let folder = folder_with("cycle.swc", b"1 1 0 0 0 1 -1\n2 2 1 0 0 1 4\n3 2 2 0 0 1 2\n4 2 3 0 0 1 3\n");
    refused(&folder, &["run", "cycle.swc"], 3, &["cycle.swc", "cycle", "line"]);
}

#[test]
fn misspelt_key() {
    let config = "schema = 1\nname = \"x\"\n[input]\nphantom = \"neuron\"\n[embed.pso]\nparticels = 64\n";
    let folder = folder_with("typo.toml", config.as_bytes());
    refused(
        &folder,
        &["run", "typo.toml"],
        2,
        &["error[E-CONFIG]", "typo.toml:6", "particels", "did you mean particles?"],
    );
    refused(
        &folder,
        &["run", "missing.swc", "--set", "embed.pso.particels=4"],
        2,
        &["--set embed.pso.particels=4", "did you mean particles?"],
    );
}

#[test]
fn value_out_of_range() {
    let config = "schema = 1\nname = \"x\"\n[input]\nphantom = \"neuron\"\n[embed]\nw_angle = 2\n[embed.pso]\nparticles = 0\n";
    let folder = folder_with("range.toml", config.as_bytes());
    refused(&folder, &["run", "range.toml"], 2, &["range.toml:8", "embed.pso.particles", "is 0"]);
}

#[test]
fn value_of_the_wrong_type() {
    let config = "schema = 1\nname = \"x\"\n[input]\nphantom = \"neuron\"\n[embed]\nw_angle = \"three\"\n";
    let folder = folder_with("type.toml", config.as_bytes());
    refused(
        &folder,
        &["run", "type.toml"],
        2,
        &["type.toml:6", "found the text \"three\", expected a number"],
    );
    let folder = folder_with("latin.toml", b"schema = 1\nname = \"caf\xe9\"\n");
    refused(&folder, &["run", "latin.toml"], 2, &["latin.toml", "UTF-8"]);
}

#[test]
fn wrong_usage() {
    let folder = tempfile::tempdir().expect("temporary folder");
    refused(&folder, &["run"], 2, &["error[E-USAGE]: the following required", "Usage"]);
    refused(&folder, &[], 2, &["error[E-USAGE]: there is no command", "espalier run"]);
    refused(&folder, &["run", "x.swc", "-q", "-v"], 2, &["error[E-USAGE]", "--quiet"]);
    refused(&folder, &["run", "x.swc", "--from", "emebd"], 2, &["emebd", "embed"]);
    refused(&folder, &["skeleton", "a.nii.gz", "b.nii.gz", "-o", "x"], 2, &["error[E-USAGE]", "mask"]);
}

#[test]
fn output_folder_that_cannot_be() {
    let folder = folder_with("ok.swc", b"1 1 0 0 0 1 -1\n2 2 1 0 0 1 1\n");
    fs::write(folder.path().join("taken"), b"a file").expect("write");
    refused(&folder, &["run", "ok.swc", "-o", "taken/run"], 73, &["error[E-IO-CREATE]", "taken"]);
}

#[test]
fn a_folder_at_work_is_refused() {
    let folder = folder_with("ok.swc", b"1 1 0 0 0 1 -1\n2 2 1 0 0 1 1\n");
    let out = folder.path().join("held");
    fs::create_dir(&out).expect("folder");
    let lock = fs::File::create(out.join(".lock")).expect("lock file");
    lock.lock().expect("lock");
    refused(&folder, &["run", "ok.swc", "-o", "held"], 75, &["error[E-RUN-LOCKED]", "another run"]);
    drop(lock);
    assert_eq!(espalier(folder.path(), &["run", "ok.swc", "-o", "held"]).status.code(), Some(0));
}

/// A whole run, then the same in pieces: stage by stage on files, and again from the middle.
#[test]
fn stages_on_their_own_equal_a_run() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let run = |arguments: &[&str]| {
        let output = espalier(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    run(&["phantom", "y", "-o", "y"]);
    let quick = "render.width_px=300";
    let swarm = [
        "--set",
        "embed.pso.particles=16",
        "--set",
        "embed.pso.iterations=4",
        "--set",
        "name=y",
        "--set",
        quick,
    ];
    let with_swarm = |arguments: &[&str]| run(&[arguments, &swarm].concat());
    let first = with_swarm(&["run", "y/truth-mask.nii.gz", "-o", "whole"]);
    with_swarm(&["volume", "y/truth-mask.nii.gz", "-o", "pieces"]);
    with_swarm(&["skeleton", "pieces/stages/01-volume/mask.nii.gz", "-o", "pieces"]);
    let (mask, skeleton) =
        ("pieces/stages/01-volume/mask.nii.gz", "pieces/stages/02-skeleton/skeleton.nii.gz");
    with_swarm(&["radius", mask, skeleton, "-o", "pieces"]);
    with_swarm(&["tree", mask, skeleton, "pieces/stages/03-radius/spheres.tsv", "-o", "pieces"]);
    with_swarm(&["views", "pieces/tree.swc", "-o", "pieces"]);
    with_swarm(&["embed", "pieces/tree.swc", "pieces/views.json", "-o", "pieces"]);
    with_swarm(&["render", "pieces/tree.swc", "pieces/views.json", "pieces/embedding.json", "-o", "pieces"]);
    for file in [
        "tree.swc",
        "topology.tsv",
        "views.json",
        "embedding.json",
        "nodes.tsv",
        "planar.png",
        "planar.svg",
        "global-view.png",
    ] {
        let [whole, pieces] =
            ["whole", "pieces"].map(|run| fs::read(folder.path().join(run).join(file)).expect("file"));
        assert!(whole == pieces, "{file} differs");
    }
    let digest = |text: &str| text.lines().last().map(str::to_owned);
    assert_eq!(digest(&run(&["embed", "whole"])), digest(&first), "the same again");
    assert_eq!(
        digest(&with_swarm(&["run", "y/truth-mask.nii.gz", "-o", "whole", "--from", "tree"])),
        digest(&first)
    );
}

/// Each stage of a run folder, in place and into another folder, from a file that lies elsewhere.
#[test]
fn stages_of_a_run_folder() {
    let swc = "1 1 0 0 0 1 -1\n2 3 0 0 9 1 1\n3 3 4 0 15 1 2\n4 3 -4 1 15 1 2\n";
    let folder = folder_with("n (1).swc", swc.as_bytes());
    let run = |arguments: &[&str]| {
        let output = espalier(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
        String::from_utf8_lossy(&output.stdout).lines().last().map(str::to_owned)
    };
    let settings = [
        "--set",
        "embed.pso.particles=16",
        "--set",
        "embed.pso.iterations=4",
        "--set",
        "render.width_px=300",
    ];
    let first = run(&[["run", "n (1).swc", "-o", "deep/down/run"].as_slice(), &settings].concat());
    for stage in ["tree", "views", "embed", "render"] {
        assert_eq!(run(&[stage, "deep/down/run"]), first, "{stage} in place");
    }
    for (stage, result) in [("tree", "tree.swc"), ("embed", "embedding.json"), ("render", "planar.png")] {
        run(&[stage, "deep/down/run", "-o", stage]);
        let [own, other] =
            ["deep/down/run", stage].map(|run| fs::read(folder.path().join(run).join(result)).expect("file"));
        assert!(own == other, "{stage} into another folder");
    }
}

#[test]
fn verify_prints_a_table_and_fails_where_a_claim_does() {
    let folder = folder_with("y.swc", b"1 1 0 0 0 1 -1\n2 3 0 0 9 1 1\n3 3 4 0 15 1 2\n4 3 -4 1 15 1 2\n");
    let small = ["--set", "embed.pso.particles=3", "--set", "embed.pso.iterations=1"];
    let run = [&["run", "y.swc", "-o", "out"], &small[..]].concat();
    assert_eq!(espalier(folder.path(), &run).status.code(), Some(0));
    let before = listing(folder.path());
    let output = espalier(folder.path(), &["verify", "out"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(0), "{text}{}", stderr(&output));
    assert!(text.contains("crossings") && text.contains(" 0 fail, ") && text.contains("digest "), "{text}");
    assert_eq!(listing(folder.path()), before, "nothing is written");

    let table = folder.path().join("out/compare.tsv");
    let changed = fs::read_to_string(&table).expect("a table").replacen("radial\t0", "radial\t1", 1);
    fs::write(&table, changed).expect("write");
    let output = espalier(folder.path(), &["verify", "out", "--json"]);
    let json: String = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(8), "{json}");
    assert!(json.contains("\"holds\": false"), "{json}");
    assert!(stderr(&output).contains("\"code\":\"E-VERIFY\""), "{}", stderr(&output));
    fs::remove_file(folder.path().join("out/nodes.tsv")).expect("remove");
    refused(&folder, &["verify", "out"], 8, &["error[E-VERIFY]"]);
    fs::write(folder.path().join("out/SHA256SUMS"), "no digest\n").expect("write");
    refused(&folder, &["verify", "out"], 8, &["error[E-VERIFY-MALFORMED]", "out/SHA256SUMS", "line 1"]);
    fs::remove_file(folder.path().join("out/SHA256SUMS")).expect("remove");
    refused(&folder, &["verify", "out"], 8, &["error[E-VERIFY-MALFORMED]", "out/SHA256SUMS", "no such file"]);
    refused(&folder, &["verify", "."], 8, &["error[E-VERIFY-MALFORMED]", "out/SHA256SUMS"]);

    // One that was killed, one whose list is damaged: neither hides the other, nor a run that holds.
    let good = [&["run", "y.swc", "-o", "all/z"], &small[..]].concat();
    assert_eq!(espalier(folder.path(), &good).status.code(), Some(0));
    let put = |place: &str, text: &str| {
        let path = folder.path().join(place);
        fs::create_dir_all(path.parent().expect("a folder")).expect("folder");
        fs::write(path, text).expect("write");
    };
    put("all/killed/stages/04-tree/report.json", "{}");
    put("all/listed/SHA256SUMS", "");
    let output = espalier(folder.path(), &["verify", "all"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(8), "{text}");
    assert!(stderr(&output).contains("error[E-VERIFY]"), "{}", stderr(&output));
    for place in ["all/killed/SHA256SUMS", "all/listed/SHA256SUMS", "all/z/tree.swc"] {
        assert!(text.contains(place.trim_start_matches("all/")), "{place}: {text}");
    }
    assert!(text.contains(" 2 fail, "), "{text}");
    fs::create_dir(folder.path().join("empty")).expect("folder");
    refused(
        &folder,
        &["verify", "empty"],
        8,
        &["error[E-VERIFY-MALFORMED]", "empty/SHA256SUMS", "run folder"],
    );
    refused(&folder, &["verify", "nowhere"], 74, &["error[E-IO-READ]", "nowhere"]);
}

/// The baseline of a view that a file says: of a `views.json`, of two vectors, of nothing that is one.
#[test]
fn view_of_marino_from_a_file() {
    let swc =
        "1 1 0 0 0 1 -1\n2 3 0 10 0 1 1\n3 3 -3 18 4 1 2\n4 3 -7 26 0 1 3\n5 3 3 18 2 1 2\n6 3 7 26 9 1 5\n";
    let folder = folder_with("fork.swc", swc.as_bytes());
    let config = "schema = 1\nname = \"fork\"\n[input]\npath = \"fork.swc\"\n[embed]\nmethod = \"marino\"\nmethods = []\n[render]\nwidth_px = 300\n";
    fs::write(folder.path().join("fork.toml"), config).expect("config");
    let run = |out: &str, sets: &[&str]| {
        let sets = sets.iter().flat_map(|set| ["--set", set]);
        let arguments: Vec<&str> = ["run", "fork.toml", "-o", out].into_iter().chain(sets).collect();
        let output = espalier(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
    };
    let read = |file: &str| fs::read_to_string(folder.path().join(file)).expect("file");
    let positions = |out: &str| {
        let embedding: serde_json::Value =
            serde_json::from_str(&read(&format!("{out}/embedding.json"))).expect("JSON");
        embedding["positions_mm"].clone()
    };
    run("auto", &[]);
    run("axial", &["embed.marino.view=axial"]);
    // Its own global view again, and that from the feet.
    run("same", &["embed.marino.view=file", "embed.marino.view_file=auto/views.json"]);
    assert_eq!(positions("same"), positions("auto"));
    fs::write(folder.path().join("feet.json"), r#"{ "towards_camera": [0, 0, -2], "up": [0, 1, 0] }"#)
        .expect("view");
    run("feet", &["embed.marino.view=file", "embed.marino.view_file=feet.json"]);
    assert_eq!(positions("feet"), positions("axial"));
    assert_ne!(positions("feet"), positions("auto"));
    assert!(read("feet/provenance/inputs.tsv").contains("\nmarino_view\t"));
    assert!(read("feet/compare.tsv").contains("\nmarino file\t"));
    let again = espalier(folder.path(), &["embed", "feet"]);
    assert_eq!(again.status.code(), Some(0), "{}", stderr(&again));

    let refuse = |sets: &[&str], code: i32, fragments: &[&str]| {
        let sets = sets.iter().flat_map(|set| ["--set", set]);
        let arguments: Vec<&str> = ["run", "fork.toml", "-o", "feet"].into_iter().chain(sets).collect();
        refused(&folder, &arguments, code, fragments);
    };
    let file = "embed.marino.view=file";
    refuse(&[file], 2, &["marino.view_file", "needs the name of one"]);
    refuse(&["embed.marino.view_file=feet.json"], 2, &["marino.view_file", "only"]);
    refuse(&[file, "embed.marino.view_file=nowhere.json"], 74, &["nowhere.json"]);
    refuse(&[file, "embed.marino.view_file=fork.swc"], 3, &["fork.swc", "towards_camera"]);
    fs::write(folder.path().join("flat.json"), r#"{ "towards_camera": [0, 0, -2], "up": [0, 0, 1] }"#)
        .expect("view");
    refuse(
        &[file, "embed.marino.view_file=flat.json"],
        3,
        &["flat.json", "up is along towards_camera", "hint"],
    );
}

/// A neuron of a stem and two branches, its run, and edits of it.
#[test]
fn manual_edits() {
    let swc =
        "1 1 0 0 0 1 -1\n2 3 0 10 0 1 1\n3 3 -3 18 0 1 2\n4 3 -7 26 0 1 3\n5 3 3 18 0 1 2\n6 3 7 26 0 1 5\n";
    let folder = folder_with("fork.swc", swc.as_bytes());
    let config = "schema = 1\nname = \"fork\"\n[input]\npath = \"fork.swc\"\n[embed]\nmethods = []\n[render]\nwidth_px = 300\n";
    fs::write(folder.path().join("fork.toml"), config).expect("config");
    let run = |arguments: &[&str]| {
        let output = espalier(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
        String::from_utf8_lossy(&output.stdout).lines().last().map(str::to_owned)
    };
    let plain = run(&["run", "fork.toml", "-o", "out"]);
    let read = |file: &str| fs::read_to_string(folder.path().join("out").join(file)).expect("file");
    let plain_embedding: serde_json::Value = serde_json::from_str(&read("embedding.json")).expect("JSON");
    let digest = plain_embedding["tree"].as_str().expect("a digest");
    let write = |name: &str, edits: &str| {
        let text = format!(
            "{{ \"format\": \"espalier-edits\", \"version\": 1,\n\"tree\": \"{digest}\",\n\"edits\": [\n{edits}\n] }}\n"
        );
        fs::write(folder.path().join(name), text).expect("edits");
    };
    let edit = |branch: usize, node: usize, angle_deg: f64| {
        format!("{{ \"branch\": {branch}, \"node\": {node}, \"angle_deg\": {angle_deg} }}")
    };

    write("edits.json", &edit(2, 1, 40.0));
    let with_edits = ["--set", "embed.edits=edits.json"];
    let from_embed = ["run", "fork.toml", "-o", "out", "--from", "embed"];
    let edited = run(&[from_embed.as_slice(), &with_edits].concat());
    assert_ne!(edited, plain);
    let embedding: serde_json::Value = serde_json::from_str(&read("embedding.json")).expect("JSON");
    let reached = embedding["edits"][0]["angle_reached_deg"].as_f64().expect("a number");
    assert!((reached - 40.0).abs() < 1e-9, "{reached}");
    assert!(read("provenance/inputs.tsv").contains("\nedits\t"));
    assert!(!read("provenance/config.resolved.toml").contains(folder.path().to_str().expect("a path")));
    run(&["verify", "out"]);
    // The same again: from the start, as a stage of the run folder, and from a folder elsewhere.
    assert_eq!(run(&["run", "fork.toml", "-o", "again", "--set", "embed.edits=edits.json"]), edited);
    assert_eq!(run(&["embed", "out"]), edited);
    assert_eq!(run(&[["embed", "out"].as_slice(), &with_edits].concat()), run(&["embed", "again"]));
    assert_eq!(run(&["render", "out"]), edited);

    // A picture of other edits is not made.
    write("edits.json", &edit(2, 1, 41.0));
    let render = ["run", "fork.toml", "-o", "out", "--from", "render", "--set", "embed.edits=edits.json"];
    refused(&folder, &render, 2, &["was not made from", "edits.json", "--from embed"]);
    // Nor are edits made that cannot be; what is there stays.
    let before = read("SHA256SUMS");
    let refuse = |edits: &str, code: i32, fragments: &[&str]| {
        write("bad.json", edits);
        let arguments = [from_embed.as_slice(), &["--set", "embed.edits=bad.json"]].concat();
        refused(&folder, &arguments, code, fragments);
        assert_eq!(read("SHA256SUMS"), before);
    };
    refuse(
        &edit(3, 1, 40.0),
        3,
        &[
            "error[E-FILE-INVALID]",
            "bad.json",
            "line 4: edits[0]: there is no branch 3: they are 0 to 2",
            "hint",
        ],
    );
    refuse("{ \"branch\": 1, }", 3, &["bad.json", "line 4"]);
    // Back onto the stem.
    let at = |node: usize| {
        let at = |axis: usize| plain_embedding["positions_mm"][node][axis].as_f64().expect("a coordinate");
        glam::DVec2::new(at(0), at(1))
    };
    let back_deg = (at(4) - at(1)).angle_to(at(0) - at(1)).to_degrees();
    let turn = format!("{},\n{}", edit(1, 2, 3.0), edit(2, 1, back_deg));
    refuse(&turn, 3, &["E-EMBED-EDIT-FOLD", "edits[1]"]);
    refused(
        &folder,
        &[from_embed.as_slice(), &["--set", "embed.edits=nowhere.json"]].concat(),
        74,
        &["nowhere.json", "relative to the config"],
    );
    // Without them again: the first run's result.
    assert_eq!(run(&["run", "fork.toml", "-o", "out", "--from", "embed"]), plain);
    run(&["embed", "again", "--set", "embed.edits="]);
    run(&["render", "again"]);
    assert_eq!(run(&["report", "again"]), plain);
}

#[test]
fn the_way_to_a_tip() {
    let folder = folder_with("tree.swc", SMALL_TREE.as_bytes());
    let output = espalier(folder.path(), &["run", "tree.swc", "-o", "out", "--to", "tree", "-q"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let way = |place: &[&str]| {
        let output = espalier(folder.path(), &[["profile", "out"].as_slice(), place].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let table = way(&["--tip", "3"]);
    assert!(table.starts_with("branch\tnode\tfrom_start_mm\t"), "{table}");
    assert_eq!(table.lines().count(), 5, "{table}");
    assert_eq!(way(&["--branch", "1"]), table);
    assert_eq!(way(&["--to=0.02,0.05,0.01"]), table);
    assert_eq!(way(&["--to", "-0.02,0.05,0.01"]), way(&["--node", "5"]));
    refused(&folder, &["profile", "out", "--branch", "3"], 2, &["no branch 3", "branches.tsv"]);
    refused(&folder, &["profile", "out"], 2, &["--node"]);
    refused(&folder, &["profile", "nowhere", "--node", "1"], 74, &["nowhere"]);
}

/// A fork with a bend in each arm, as SWC in µm.
const SMALL_TREE: &str = "\
1 0 0 0 0 2 -1\n2 0 0 20 0 2 1\n3 0 15 30 5 1 2\n4 0 20 45 9 1 3\n5 0 -12 31 -6 1 2\n6 0 -20 40 3 1 5\n";

/// Runs the tree up to the embedding with these settings.
fn embedded(folder: &Path, out: &str, settings: &[&str]) {
    let mut arguments = vec!["run", "tree.swc", "-o", out, "--to", "embed", "-q"];
    arguments.extend(["--set", "embed.pso.particles=16", "--set", "embed.pso.iterations=3"]);
    arguments.extend(settings.iter().flat_map(|setting| ["--set", setting]));
    let output = espalier(folder, &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

#[test]
fn two_runs_are_compared() {
    let folder = folder_with("tree.swc", SMALL_TREE.as_bytes());
    let read = |file: &str| fs::read_to_string(folder.path().join(file)).expect(file);
    embedded(folder.path(), "a", &[]);
    embedded(folder.path(), "b", &["embed.targets=projected"]);
    let output = espalier(folder.path(), &["compare", "a", "b", "-o", "both", "-q"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let n_methods = read("a/compare.tsv").lines().count() - 1;
    assert!(n_methods >= 5 && text.contains("both/compare.png"), "{text}");
    assert_eq!(
        text.lines().filter(|line| line.starts_with("a ") || line.starts_with("b ")).count(),
        2 * n_methods
    );
    assert_eq!(
        text.lines().filter(|line| line.contains(" > ") && !line.starts_with('*')).count(),
        2,
        "{text}"
    );

    // The rows are those of the runs, with their names before them.
    let own: Vec<String> = read("a/compare.tsv").lines().skip(1).map(|line| format!("a\t{line}")).collect();
    let table = read("both/compare.tsv");
    assert_eq!(table.lines().skip(1).take(n_methods).collect::<Vec<_>>(), own);
    let runs = espalier_model::ComparedRuns::from_json(&read("both/compare.json")).expect("our own file");
    assert_eq!(runs.to_tsv(), table);
    let dictionary = read("both/dictionary.tsv");
    for column in table.lines().next().expect("a header").split('\t') {
        assert!(dictionary.contains(&format!("\t{column}\t")), "{column} is not explained");
    }
    // Runs without a name of their own are called by their folders, runs with titles by these.
    let has = |file: &str, text: &str| read(file).contains(&format!(">{text}</text>"));
    assert!(has("both/compare.svg", "a") && has("both/compare.svg", "b"));
    embedded(folder.path(), "c", &["name=\"patient 5\""]);
    embedded(folder.path(), "d", &["name=\"patient 5\""]);
    embedded(folder.path(), "e", &["render.title=\"after\""]);
    let named = espalier(folder.path(), &["compare", "c", "d", "e", "-o", "named", "-q"]);
    assert_eq!(named.status.code(), Some(0), "{}", stderr(&named));
    for title in ["patient 5 (c)", "patient 5 (d)", "after"] {
        assert!(has("named/compare.svg", title), "{title}");
    }
    // No result knows a time: the same bytes again, on one thread.
    let again = espalier(folder.path(), &["compare", "a", "b", "-o", "again", "-q", "--threads", "1"]);
    assert_eq!(again.status.code(), Some(0), "{}", stderr(&again));
    assert_eq!(read("again/SHA256SUMS"), read("both/SHA256SUMS"));
}

#[test]
fn a_config_is_run_before_it_is_compared() {
    let folder = folder_with("tree.swc", SMALL_TREE.as_bytes());
    let output =
        espalier(folder.path(), &["compare", "tree.swc", "--set", "embed.pso.iterations=2", "-o", "c"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(
        folder.path().join("c/tree/embedding.json").exists() && folder.path().join("c/compare.svg").exists()
    );
    assert!(!folder.path().join("c/tree/planar.png").exists(), "no pictures of its own");
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let folder = folder_with("tree.swc", SMALL_TREE.as_bytes());
    embedded(folder.path(), "a", &[]);
    fs::create_dir(folder.path().join("empty")).expect("folder");
    refused(
        &folder,
        &["compare", "empty", "-o", "x"],
        74,
        &["error[E-COMPARE-NO-RUN]", "empty holds no run", "hint", "--to embed"],
    );
    refused(&folder, &["compare", "nowhere", "-o", "x"], 74, &["nowhere"]);
    refused(
        &folder,
        &["compare", "a", "-o", "a"],
        2,
        &["error[E-COMPARE-FOLDER]", "a is a run folder", "hint", "-o"],
    );
    refused(
        &folder,
        &["compare", "a", "--set", "embed.w_angle=1", "-o", "x"],
        2,
        &["error[E-COMPARE-SETTINGS]", "--set embed.w_angle", "render.*"],
    );
    refused(&folder, &["compare"], 2, &["RUN|CONFIG"]);
    // A layout that was edited afterwards is found out, with or without the digests.
    let file = folder.path().join("a/compare.json");
    let text = fs::read_to_string(&file).expect("text");
    fs::write(&file, text.replacen("\"crossings\":0", "\"crossings\":1", 1)).expect("write");
    refused(&folder, &["compare", "a", "-o", "x"], 8, &["a/compare.json", "SHA256SUMS"]);
    fs::remove_file(folder.path().join("a/SHA256SUMS")).expect("remove");
    refused(
        &folder,
        &["compare", "a", "-o", "x"],
        8,
        &["error[E-RUN-CERTIFICATE]", "states 1 crossings, its coordinates have 0"],
    );
    fs::remove_file(&file).expect("remove");
    refused(&folder, &["compare", "a", "-o", "x"], 74, &["there is no compare.json"]);
}

#[test]
fn two_keys_are_swept() {
    let folder = folder_with("tree.swc", SMALL_TREE.as_bytes());
    let read = |file: &str| fs::read_to_string(folder.path().join(file)).expect(file);
    let sweep = |out: &str, threads: &str| {
        let axes = ["--over", "embed.w_length=0.5,-1,2", "--over", "embed.method=radial,solver"];
        let small = ["--set", "embed.pso.particles=16", "--set", "embed.pso.iterations=2", "-q"];
        let arguments =
            [&["sweep", "tree.swc", "-o", out, "--threads", threads], &axes[..], &small[..]].concat();
        espalier(folder.path(), &arguments)
    };
    let output = sweep("s", "2");
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let table = read("s/sweep.tsv");
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split('\t').collect()).collect();
    assert_eq!(rows[0][..5], ["combination", "embed.w_length", "embed.method", "method", "crossings"]);
    assert_eq!(rows.len(), 7);
    for (row, [length, method]) in rows[1..].iter().zip(
        ["0.5", "-1", "2"].iter().flat_map(|length| ["radial", "solver"].map(|method| [*length, method])),
    ) {
        assert_eq!(row[1..3], [length, method]);
        let error = row[row.len() - 1];
        if length == "-1" {
            assert!(row[3] == "n/a" && error.contains("must be from 0 to 1e6, is -1"), "{row:?}");
        } else {
            assert!(row[4] == "0" && error.is_empty(), "{row:?}");
        }
    }
    // A row is what a run with those settings comes to.
    embedded(folder.path(), "alone", &["embed.w_length=2", "embed.method=radial", "embed.pso.iterations=2"]);
    let chosen = espalier_model::swc::read_tree(&read("alone/tree.swc")).expect("a tree");
    let comparison =
        espalier_model::Comparison::from_json(&read("alone/compare.json"), &chosen).expect("a file");
    let row = &comparison.layouts[comparison.chosen].row;
    let own = espalier_model::MethodRow::to_tsv(std::slice::from_ref(row));
    assert_eq!(own.lines().nth(1).expect("a row"), rows[5][3..rows[5].len() - 1].join("\t"));
    // What the combinations share is there once.
    assert!(folder.path().join("s/base/views.json").exists());
    assert!(!folder.path().join("s/runs/001/views.json").exists());
    for file in ["s/sweep.png", "s/sweep.svg"] {
        assert!(folder.path().join(file).exists(), "{file}");
    }
    let dictionary = read("s/dictionary.tsv");
    assert!(rows[0].iter().all(|column| dictionary.contains(&format!("\t{column}\t"))));
    let again = sweep("again", "1");
    assert_eq!(again.status.code(), Some(0), "{}", stderr(&again));
    assert_eq!(read("again/SHA256SUMS"), read("s/SHA256SUMS"));
}

#[test]
fn a_sweep_in_vain_is_refused() {
    let folder = folder_with("tree.swc", SMALL_TREE.as_bytes());
    let refuse = |over: &[&str], fragments: &[&str]| {
        let mut arguments = vec!["sweep", "tree.swc", "-o", "x"];
        arguments.extend(over.iter().flat_map(|axis| ["--over", axis]));
        refused(&folder, &arguments, 2, fragments);
    };
    refuse(&["embed.w_lenght=1,2"], &["w_lenght", "did you mean w_length?"]);
    refuse(&["embed.w_length="], &["KEY=V1,V2"]);
    refuse(&[], &["--over"]);
    refuse(&["embed.w_length=-1,-2"], &["--set embed.w_length=-1", "must be from 0"]);
    refuse(&["render.width_px=300,400"], &["error[E-SWEEP]", "no embedding depends on it"]);
    refuse(&["embed.w_length=1,2", "embed.w_length=3"], &["is given twice"]);
    let many = format!("seed={}", (0..200).map(|i| i.to_string()).collect::<Vec<_>>().join(","));
    refuse(&[&many, &many.replace("seed", "views.seed_of_nothing")], &["40000 combinations", "10000"]);
}

/// A fork whose left arm is `left` wide, without or with a third arm.
fn fork(left: f64, has_third: bool) -> String {
    let third = if has_third { "5 3 0 0 -30 1 2\n" } else { "" };
    format!("1 3 0 0 40 4 -1\n2 3 0 0 0 4 1\n3 3 -20 5 -25 {left} 2\n4 3 24 2 -18 3 2\n{third}")
}

#[test]
fn a_follow_up_is_held_against_its_baseline() {
    let folder = folder_with("before.swc", fork(3.0, false).as_bytes());
    std::fs::write(folder.path().join("after.swc"), fork(1.5, true)).expect("written");
    let quick = ["--set", "embed.pso.iterations=2", "-q"];
    let arguments = |more: &[&'static str]| [more, &quick].concat();
    let output = espalier(folder.path(), &arguments(&["juxtapose", "before.swc", "after.swc", "-o", "j"]));
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let read = |file: &str| std::fs::read_to_string(folder.path().join(file)).expect(file);
    let rows: Vec<Vec<String>> = read("j/juxtaposition.tsv")
        .lines()
        .map(|line| line.split('\t').map(str::to_owned).collect())
        .collect();
    let cell = |row: usize, name: &str| {
        let column = rows[0].iter().position(|column| column == name).expect(name);
        rows[row][column].as_str()
    };
    let fates: Vec<&str> = (1..rows.len()).map(|row| cell(row, "fate")).collect();
    assert_eq!(fates, ["matched", "matched", "matched", "new"]);
    assert_eq!(cell(2, "radius_change_percent"), "-50.00");
    assert_eq!(cell(3, "radius_change_percent"), "0.00");
    let dictionary = read("j/dictionary.tsv");
    for (table, file) in
        [("juxtaposition.tsv", "j/juxtaposition.tsv"), ("shared-nodes.tsv", "j/shared-nodes.tsv")]
    {
        for column in read(file).lines().next().expect("a header").split('\t') {
            assert!(dictionary.contains(&format!("{table}\t{column}\t")), "{column} is not explained");
        }
    }
    let sums = read("j/SHA256SUMS");
    for file in [
        "juxtaposition.png",
        "juxtaposition.svg",
        "juxtaposition.json",
        "shared.swc",
        "shared-embedding.json",
    ] {
        assert!(sums.contains(file), "{file} in {sums}");
    }
    // The runs that it made serve again, on one thread and to the same bytes.
    let again = ["juxtapose", "j/before", "j/after", "-o", "again", "--threads", "1"];
    let output = espalier(folder.path(), &arguments(&again));
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(read("again/SHA256SUMS"), sums);

    let refused =
        espalier(folder.path(), &["juxtapose", "j/before", "j/after", "--set", "tree.prune_factor=3"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("E-JUXTAPOSE-SETTINGS"), "{}", stderr(&refused));
    std::fs::create_dir(folder.path().join("empty")).expect("made");
    let refused = espalier(folder.path(), &["juxtapose", "empty", "j/after"]);
    assert_eq!(refused.status.code(), Some(74));
    assert!(stderr(&refused).contains("E-JUXTAPOSE-NO-TREE"), "{}", stderr(&refused));
}
