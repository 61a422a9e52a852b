//! `espalier verify`: what a run writes holds, and what is changed in a copy of it is found.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use espalier_model::Diagnose;
use espalier_model::diagnose::Class;
use espalier_pipeline::{Check, Error, GroupRequest, Outcome, Override, Stage, group as group_of, verify};
use espalier_tests::{run, run_range, set, small_swarm};
use tempfile::TempDir;

/// A run of the fixture neuron.
fn run_folder(overrides: &[Override]) -> TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/neuron.swc");
    let all: Vec<Override> = small_swarm().into_iter().chain(overrides.iter().cloned()).collect();
    run(&fixture, folder.path(), &all, 2).expect("a run");
    folder
}

/// The claims that fail, as `file: claim`.
fn failures(folder: &Path) -> Vec<String> {
    let verification = verify(folder, Some(2)).expect("a readable folder");
    let failed = verification.checks.iter().filter(|(_, check)| check.outcome == Outcome::Fails);
    failed.map(|(file, check)| format!("{file}: {}", check.name)).collect()
}

/// A copy of a run folder with one file changed; its digest put right too if `is_resealed`.
fn tampered(original: &Path, file: &str, is_resealed: bool, change: impl FnOnce(&str) -> String) -> TempDir {
    let copy = tempfile::tempdir().expect("temporary folder");
    copy_folder(original, copy.path());
    let path = copy.path().join(file);
    let text = fs::read_to_string(&path).expect("text");
    let changed = change(&text);
    assert!(changed != text, "nothing was changed in {file}");
    fs::write(&path, changed).expect("write");
    if is_resealed {
        reseal(copy.path(), file);
    }
    copy
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("folder");
    for entry in fs::read_dir(from).expect("folder") {
        let path = entry.expect("entry").path();
        let target = to.join(path.file_name().expect("a name"));
        if path.is_dir() { copy_folder(&path, &target) } else { _ = fs::copy(&path, &target).expect("copy") }
    }
}

/// Gives a file the digest that `SHA256SUMS` asks for, as someone would who knows how it is made.
fn reseal(folder: &Path, file: &str) {
    let sums = fs::read_to_string(folder.join("SHA256SUMS")).expect("SHA256SUMS");
    let failed = verify_digest(folder, file);
    let sealed: Vec<String> =
        sums.lines()
            .map(|line| {
                if line.ends_with(&format!("  {file}")) {
                    format!("{failed}  {file}")
                } else {
                    line.to_owned()
                }
            })
            .collect();
    fs::write(folder.join("SHA256SUMS"), sealed.join("\n") + "\n").expect("write");
}

/// The digest that `verify` finds for a file.
fn verify_digest(folder: &Path, file: &str) -> String {
    let verification = verify(folder, Some(1)).expect("a readable folder");
    let check = verification.checks.iter().find(|(name, check)| name == file && check.name == "sha256");
    check.expect("a digest").1.found.to_string()
}

/// The number at a place of an array in JSON, changed.
fn change_number(text: &str, array: &str, place: usize, change: impl Fn(f64) -> f64) -> String {
    let start = text.find(array).expect("the array") + array.len();
    let is_number = |c: char| c.is_ascii_digit() || "+-.eE".contains(c);
    let mut rest = start;
    for _ in 0..place {
        rest += text[rest..].find(is_number).expect("a number");
        rest += text[rest..].find(|c| !is_number(c)).expect("an end");
    }
    rest += text[rest..].find(is_number).expect("a number");
    let end = rest + text[rest..].find(|c| !is_number(c)).expect("an end");
    let number: f64 = text[rest..end].parse().expect("a number");
    format!("{}{:?}{}", &text[..rest], change(number), &text[end..])
}

#[test]
fn runs_hold_whatever_their_settings() {
    for overrides in [
        vec![],
        vec![set("embed.method", "radial")],
        vec![set("embed.widths.mode", "avoid"), set("input.radius_scale", 3.0)],
        vec![set("embed.method", "pso"), set("embed.targets", "projected"), set("embed.pso.freedom", "s")],
        vec![set("embed.w_side", 2.0), set("embed.w_crossing", 500.0), set("embed.pose", "view")],
        vec![set(
            "embed.weights",
            "[{ generations = [0, 1], w_length = 7.0 }, { nodes = [3], w_angle = 0.0 }]",
        )],
    ] {
        let folder = run_folder(&overrides);
        let verification = verify(folder.path(), Some(2)).expect("a readable folder");
        let failed: Vec<_> = verification.checks.iter().filter(|(_, check)| check.fails()).collect();
        assert!(failed.is_empty(), "{overrides:?}: {failed:?}");
        assert!(verification.verdict().is_ok() && verification.checks.len() > 40);
        let json = verification.to_json();
        assert!(json.contains("\"format\": \"espalier-verification\"") && json.contains("\"holds\": true"));
    }
}

#[test]
fn a_run_from_a_mask_holds() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/y.nii.gz");
    run(&fixture, folder.path(), &small_swarm(), 2).expect("a run");
    let verification = verify(folder.path(), Some(2)).expect("a readable folder");
    let failed: Vec<_> = verification.checks.iter().filter(|(_, check)| check.fails()).collect();
    assert!(failed.is_empty(), "{failed:?}");
    // Tables of the tree stage are held against the dictionary, spheres too, whose first line names their format.
    for table in ["branches.tsv", "profiles.tsv", "stages/03-radius/spheres.tsv"] {
        let is_checked = |(file, check): &(String, Check)| file == table && check.name == "columns";
        assert!(verification.checks.iter().any(is_checked), "{table}");
    }
}

#[test]
fn what_is_changed_is_found() {
    let original = run_folder(&[]);
    let change = |file: &str, is_resealed, change: &dyn Fn(&str) -> String| {
        tampered(original.path(), file, is_resealed, change)
    };
    let embedding = "embedding.json";

    // One byte of a picture, which nothing else looks into.
    let byte = change("planar.svg", false, &|text| text.replacen("svg", "svG", 1));
    assert_eq!(failures(byte.path()), ["planar.svg: sha256"]);
    let error = verify(byte.path(), Some(1)).expect("readable").verdict().expect_err("altered");
    assert_eq!((error.code(), error.class()), ("E-VERIFY", Class::Uncertified));
    assert!(error.to_string().contains("planar.svg, sha256"), "{error}");

    // A file that the digests pass over.
    let unsealed = change("SHA256SUMS", false, &|text| {
        let kept = text.lines().filter(|line| !line.ends_with("  nodes.tsv"));
        kept.map(|line| format!("{line}\n")).collect()
    });
    assert_eq!(failures(unsealed.path()), ["nodes.tsv: sealed"]);

    // One coordinate, by ten thousand steps, digest put right.
    let moved = change(embedding, true, &|text| {
        change_number(text, "\"positions_mm\":", 40, |x| {
            format!("{:.9}", x + 1e-5).parse().expect("a number")
        })
    });
    let found = failures(moved.path());
    for claim in ["embedding.json: length ratios", "compare.json: chosen", "nodes.tsv: nodes"] {
        assert!(found.iter().any(|failure| failure == claim), "{claim}: {found:?}");
    }

    // One ratio, one loss, one target.
    for (array, place, claim) in [
        ("\"angle_ratio\":", 30, "embedding.json: angle ratios"),
        ("\"losses\":{\"length_loss_mean\":", 0, "embedding.json: length_loss_mean"),
        ("\"heading_rad\":", 12, "embedding.json: target headings"),
        ("\"energy\":{\"length\":", 0, "embedding.json: energy of lengths"),
    ] {
        let changed = change(embedding, true, &|text| change_number(text, array, place, |x| x + 1e-4));
        let found = failures(changed.path());
        assert!(found.iter().any(|failure| failure == claim), "{claim}: {found:?}");
    }

    // A number of the widths, the way the picture lies, a point of the search.
    for (array, place, claim) in [
        ("\"radius_scale\":", 0, "embedding.json: widths: radius scale"),
        ("\"area_needed_mm2\":", 0, "embedding.json: widths: area needed"),
        ("\"area_available_mm2\":", 0, "embedding.json: widths: area available"),
        ("\"length_scale\":", 0, "embedding.json: widths: length scale"),
    ] {
        let changed = change(embedding, true, &|text| change_number(text, array, place, |x| x + 1e-3));
        let found = failures(changed.path());
        assert!(found.iter().any(|failure| failure == claim), "{claim}: {found:?}");
    }

    // A column of a table under another name.
    let column = change("topology.tsv", true, &|text| text.replacen("reason", "cause", 1));
    assert_eq!(failures(column.path()), ["topology.tsv: columns"]);

    // A cell of a table; a layout of another method; a setting.
    let cell = change("compare.tsv", true, &|text| text.replacen("\nradial\t0", "\nradial\t2", 1));
    assert_eq!(failures(cell.path()), ["compare.tsv: methods"]);
    let layout = change("compare.json", true, &|text| text.replacen("\"stress\":0.", "\"stress\":0.0", 1));
    assert!(failures(layout.path()).iter().any(|failure| failure.starts_with("compare.json: layout of")));
    let config = "provenance/config.resolved.toml";
    let setting = change(config, true, &|text| text.replacen("w_placement = 0.01", "w_placement = 0.02", 1));
    assert!(failures(setting.path()).contains(&"embedding.json: energy of placement".to_owned()));
}

#[test]
fn what_cannot_be_read_is_said_so() {
    let original = run_folder(&[]);
    let class = |folder: &Path| match verify(folder, Some(1)) {
        Ok(verification) => verification.verdict().expect_err("a claim that fails").class(),
        Err(error) => error.class(),
    };
    // Malformed, and sealed as if it were right; only altered; a coordinate with digits too many.
    let cut = |text: &str| text[..text.len() / 2].to_owned();
    let sealed = tampered(original.path(), "embedding.json", true, cut);
    assert_eq!(class(sealed.path()), Class::Uncertified);
    assert_eq!(failures(sealed.path()), ["embedding.json: readable"]);
    let altered = tampered(original.path(), "embedding.json", false, cut);
    assert_eq!(class(altered.path()), Class::Uncertified);
    assert!(failures(altered.path()).contains(&"embedding.json: readable".to_owned()));
    let version = |text: &str| text.replacen("\"version\":", "\"version\":9", 1);
    let later = tampered(original.path(), "embedding.json", true, version);
    assert_eq!(failures(later.path()), ["embedding.json: readable"]);
    let error = verify(later.path(), Some(1)).expect("a folder").verdict().expect_err("unknown version");
    assert!(error.to_string().contains("version 93, expected"), "{error}");

    // Another tree under the same name.
    let tree = |text: &str| text.replacen(" 3 ", " 2 ", 1);
    let other = tampered(original.path(), "tree.swc", true, tree);
    assert!(failures(other.path()).contains(&"embedding.json: tree".to_owned()));

    let absent = [
        ("nodes.tsv", Class::Uncertified),
        ("tree.swc", Class::Uncertified),
        ("SHA256SUMS", Class::Uncertified),
    ];
    for (file, expected) in absent {
        let copy = tempfile::tempdir().expect("temporary folder");
        copy_folder(original.path(), copy.path());
        fs::remove_file(copy.path().join(file)).expect("remove");
        assert_eq!(class(copy.path()), expected, "{file}");
    }
    // A result that no line speaks of is one that anybody may have altered.
    let without = |text: &str| {
        text.lines().filter(|line| !line.ends_with("  planar.png")).collect::<Vec<_>>().join("\n")
    };
    let unsealed = tampered(original.path(), "SHA256SUMS", false, without);
    assert_eq!(failures(unsealed.path()), ["planar.png: sealed"]);
    let sums = tampered(original.path(), "SHA256SUMS", false, |text| format!("{text}no digest\n"));
    assert_eq!(class(sums.path()), Class::Uncertified);
    let error = verify(sums.path(), Some(1)).expect_err("a line that is none");
    assert!(error.code() == "E-VERIFY-MALFORMED" && error.line() > Some(10), "{error}");
    let nothing = tampered(original.path(), "SHA256SUMS", false, |_| String::new());
    assert!(verify(nothing.path(), Some(1)).is_err_and(|error| error.to_string().contains("names no file")));
    assert!(matches!(verify(&PathBuf::from("no/such/folder"), None), Err(Error::Read { .. })));
}

/// A run that was asked for no more than a part is held against itself as far as it has come.
#[test]
fn what_a_run_has_not_come_to_is_untested() {
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/y.nii.gz");
    for (last, untested) in [
        (Stage::Skeleton, ["tree.swc", "views.json", "embedding.json"].as_slice()),
        (Stage::Tree, &["views.json", "embedding.json"]),
        (Stage::Views, &["embedding.json"]),
        (Stage::Embed, &[]),
    ] {
        let folder = tempfile::tempdir().expect("temporary folder");
        run_range(&fixture, folder.path(), &small_swarm(), (None, Some(last))).expect("a run");
        let verification = verify(folder.path(), Some(2)).expect("a readable folder");
        assert_eq!(failures(folder.path()), [""; 0], "{last}");
        let is_untested = |check: &Check| check.outcome == Outcome::Untested && check.name == "results";
        let found = verification.checks.iter().filter(|(_, check)| is_untested(check));
        assert_eq!(found.map(|(file, _)| file.as_str()).collect::<Vec<_>>(), untested, "{last}");
        // What it has come to is not to be taken away unseen.
        let mask = "stages/01-volume/mask.nii.gz";
        fs::remove_file(folder.path().join(mask)).expect("remove");
        assert_eq!(failures(folder.path()), [format!("{mask}: sha256")]);
    }
}

/// A folder that has run folders in it stands for all of them; a folder of a group or a comparison for itself.
#[test]
fn folders_of_runs_and_of_pages_are_verified() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let at = |name: &str| folder.path().join(name);
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/neuron.swc");
    for name in ["runs/a", "runs/b"] {
        run(&fixture, &at(name), &small_swarm(), 2).expect("a run");
    }
    let group = GroupRequest {
        folders: vec![at("runs")],
        out: at("group"),
        title: None,
        is_anonymous: false,
        threads: Some(2),
    };
    group_of(&group).expect("a page");
    assert_eq!(failures(&at("group")), [""; 0]);
    let page = verify(&at("group"), Some(1)).expect("a folder");
    assert!(page.checks.iter().any(|(file, check)| file == "group.tsv" && check.name == "columns"));

    // A run that stopped before it had a result takes nothing from the others.
    fs::create_dir_all(at("runs/c/provenance")).expect("folder");
    let failure = "{\"format\":\"espalier-failure\",\"version\":1,\"stage\":null,\"code\":\"E-IO-READ\",\"reason\":\"x\"}";
    fs::write(at("runs/c/provenance/failure.json"), failure).expect("write");
    let whole = verify(folder.path(), Some(2)).expect("a folder");
    whole.verdict().expect("claims that hold");
    let has =
        |file: &str, name: &str| whole.checks.iter().any(|(of, check)| of == file && check.name == name);
    assert!(has("runs/a/tree.swc", "sha256") && has("runs/b/compare.tsv", "methods"));
    assert!(has("group/group.html", "sha256") && has("runs/c", "results"));

    fs::write(at("runs/b/planar.svg"), "altered").expect("write");
    assert_eq!(failures(folder.path()), ["runs/b/planar.svg: sha256"]);
    fs::write(at("group/group.tsv"), "label\n").expect("write");
    assert!(failures(&at("group")).contains(&"group.tsv: sha256".to_owned()));
    // Results whose list is gone do not hold, and the others are looked at all the same.
    fs::remove_file(at("runs/a/SHA256SUMS")).expect("remove");
    let failed = failures(folder.path());
    assert!(failed.contains(&"runs/a/SHA256SUMS: sealed".to_owned()), "{failed:?}");
    assert!(failed.contains(&"runs/b/planar.svg: sha256".to_owned()), "{failed:?}");
    // Of one folder there is nothing else to look at.
    let error = verify(&at("runs/a"), Some(1)).expect_err("results without a list");
    assert!(error.file().is_some_and(|file| file.ends_with("runs/a/SHA256SUMS")), "{error}");
}
