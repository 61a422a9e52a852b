//! What `--json` prints: every line is one of the schema, in order, whatever becomes of the run and of who reads.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;
mod schema;

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use program::{QUICK, Said, espalier, fork};
use serde_json::Value;
use tempfile::TempDir;

/// A fork whose tracing is larger than a neuron, so that there is a warning, and files that cannot be used.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    let put = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("write");
    put("tree.swc", &fork(20.0));
    put("negative.swc", "1 0 0 0 0 2 -1\n2 0 0 20 0 -2 1\n3 0 15 30 5 1 2\n4 0 -12 31 -6 1 2\n");
    put("bad.swc", "1 0 0 0 0 2 -1\n2 0 0 x 0 2 1\n");
    put("bad.toml", "schema = 1\n[input]\npath = \"tree.swc\"\n[tree]\nrot = 1\n");
    put("samples.tsv", "id\tpath\na\ttree.swc\nb\tbad.swc\n");
    folder
}

/// The exit code, the lines of standard error, and standard output of a program that speaks JSON.
fn told(folder: &TempDir, arguments: &[&str]) -> (Option<i32>, Vec<Value>, String) {
    let said = Said::by(&espalier(folder.path(), &[arguments, &["--json"]].concat()));
    let schema = Said::by(&espalier(folder.path(), &["info", "--events"])).out;
    let schema: Value = serde_json::from_str(&schema).expect("a schema");
    let lines: Vec<Value> =
        said.error.lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect();
    for line in &lines {
        let faults = schema::faults(&schema, line);
        assert!(faults.is_empty(), "{line}: {faults:?}");
    }
    (said.code, lines, said.out)
}

fn run(input: &'static str, more: &[&'static str]) -> Vec<&'static str> {
    [&["run", input, "-o", "out", "--to", "embed"], &QUICK[..], more].concat()
}

fn names(lines: &[Value]) -> Vec<&str> {
    lines
        .iter()
        .map(|line| line["event"].as_str().expect("a name"))
        .filter(|name| *name != "stage-progress")
        .collect()
}

fn named<'a>(lines: &'a [Value], event: &str) -> Vec<&'a Value> {
    lines.iter().filter(|line| line["event"] == event).collect()
}

#[test]
fn a_run_tells_what_it_does() {
    let folder = folder();
    let (code, lines, out) = told(&folder, &run("negative.swc", &["--set", "seed=3"]));
    assert_eq!(code, Some(0), "{lines:?}");
    let tree = ["begin", "run-started", "stage-started", "warning", "stage-done"];
    let rest = ["stage-started", "stage-done", "stage-started", "stage-done", "run-done"];
    assert_eq!(names(&lines), [tree, rest].concat());
    assert_eq!((&lines[0]["format"], &lines[0]["command"]), (&"espalier-events".into(), &"run".into()));
    assert_eq!(lines[1]["stages"], serde_json::json!(["tree", "views", "embed"]));
    let settings = lines[1]["settings"].as_array().expect("settings");
    let particles =
        settings.iter().find(|setting| setting["key"] == "embed.pso.particles").expect("a setting");
    assert_eq!((&particles["value"], particles["default"] != "16"), (&"16".into(), true), "{particles}");
    assert!(
        settings.iter().any(|setting| setting["key"] == "seed" && setting["value"] == "3"),
        "{settings:?}"
    );
    assert_eq!(lines[2]["reason"], "not done yet");
    let warning = named(&lines, "warning")[0];
    assert_eq!((&warning["code"], &warning["stage"]), (&"W-SWC-NEGATIVE-RADIUS".into(), &"tree".into()));
    assert!(warning["message"].as_str().is_some_and(|text| text.contains("line 2")), "{warning}");
    assert_eq!(warning["file"], "negative.swc");
    let done = named(&lines, "stage-done");
    assert!(done[0]["counts"]["nodes"].as_f64() > Some(1.0), "{}", done[0]);
    assert!(done.iter().all(|line| line["seconds"].as_f64() >= Some(0.0)), "{done:?}");
    assert!(done[2]["parts"].as_array().is_some_and(|parts| parts.len() > 2), "{}", done[2]);
    let progress = named(&lines, "stage-progress");
    assert!(!progress.is_empty() && progress.iter().all(|line| line["stage"] == "embed"), "{progress:?}");
    let end = lines.last().expect("a line");
    assert_eq!(
        (&end["verdict"], &end["crossings"], &end["warnings"]),
        (&"certified".into(), &0.into(), &1.into())
    );
    let result: Value = serde_json::from_str(&out).expect("one JSON text");
    assert_eq!((&result["digest"], &result["folder"]), (&end["digest"], &"out".into()), "{result}");

    // The same again has the same counts, and nothing to do; a setting says why a stage is done.
    let (code, again, result) = told(&folder, &run("negative.swc", &["--set", "seed=3"]));
    assert_eq!((code, result), (Some(0), out));
    let kept = ["begin", "run-started", "warning", "stage-kept", "stage-kept", "stage-kept", "run-done"];
    assert_eq!(names(&again), kept);
    for (kept, done) in named(&again, "stage-kept").iter().zip(&done) {
        assert_eq!((&kept["counts"], &kept["line"]), (&done["counts"], &done["line"]));
    }
    let (_, changed, _) =
        told(&folder, &run("negative.swc", &["--set", "seed=3", "--set", "embed.w_angle=3"]));
    assert_eq!(named(&changed, "stage-started")[0]["reason"], "embed.w_angle is 3.0, was 2.0");
}

/// What differs between equal runs is time and memory.
fn without_times(line: &Value) -> Value {
    match line {
        Value::Object(fields) => {
            let kept = fields.iter().filter(|(name, _)| !matches!(name.as_str(), "seconds" | "peak_mb"));
            Value::Object(kept.map(|(name, inner)| (name.clone(), without_times(inner))).collect())
        }
        Value::Array(list) => Value::Array(list.iter().map(without_times).collect()),
        other => other.clone(),
    }
}

#[test]
fn equal_runs_tell_the_same() {
    let lines_of = |threads: &'static str| {
        let folder = folder();
        let (code, lines, out) = told(&folder, &run("tree.swc", &["--threads", threads]));
        assert_eq!(code, Some(0), "{lines:?}");
        (lines.iter().map(without_times).collect::<Vec<_>>(), out)
    };
    assert_eq!(lines_of("1"), lines_of("3"));
}

#[test]
fn a_failure_is_the_last_line() {
    let folder = folder();
    let last = |arguments: &[&str], exit_code: i32| {
        let (code, mut lines, out) = told(&folder, arguments);
        assert_eq!((code, out.as_str()), (Some(exit_code), ""), "{lines:?}");
        assert_eq!(lines[0]["event"], "begin");
        let last = lines.pop().expect("a line");
        assert_eq!((&last["event"], &last["exit_code"]), (&"failed".into(), &exit_code.into()), "{last}");
        last
    };
    let swc = last(&["run", "bad.swc", "-o", "out"], 3);
    assert_eq!((&swc["code"], &swc["line"]), (&"E-SWC-NUMBER".into(), &2.into()), "{swc}");
    assert!(swc["file"].as_str().is_some_and(|file| file.ends_with("bad.swc")), "{swc}");
    assert!(swc["hint"].is_string() && swc["cause"].is_string() && swc["way_out"].is_string(), "{swc}");
    let config = last(&["run", "bad.toml"], 2);
    assert_eq!((&config["code"], &config["line"]), (&"E-CONFIG".into(), &5.into()), "{config}");
    assert_eq!(last(&["run", "nowhere.nii.gz"], 74)["file"], "nowhere.nii.gz");
    assert_eq!(last(&["run"], 2)["code"], "E-USAGE");
    assert_eq!(last(&["run", "tree.swc", "--from", "nothing"], 2)["code"], "E-USAGE");
    assert_eq!(last(&["verify", "nowhere"], 74)["code"], "E-IO-READ");
}

#[test]
fn a_cohort_tells_of_each_scan() {
    let folder = folder();
    let cohort = [&["cohort", "samples.tsv", "-o", "out"], &QUICK[..]].concat();
    let (code, lines, out) = told(&folder, &cohort);
    assert_eq!(code, Some(3), "{lines:?}");
    let scans: Vec<&str> = names(&lines).into_iter().filter(|name| name.starts_with("scan-")).collect();
    assert_eq!(scans, ["scan-started", "scan-done", "scan-started", "scan-failed"]);
    let failed = named(&lines, "scan-failed")[0];
    assert_eq!(
        (&failed["scan"], &failed["failure"]["code"]),
        (&"b".into(), &"E-SWC-NUMBER".into()),
        "{failed}"
    );
    assert_eq!(lines.last().map(|line| &line["code"]), Some(&"E-COHORT-FAILED".into()));
    let result: Value = serde_json::from_str(&out).expect("one JSON text");
    assert_eq!(result["failed"][0]["scan"], "b", "{result}");
}

/// A reader that has had enough, of either stream, takes nothing from the results and is no error.
#[test]
fn a_closed_pipe_loses_nothing() {
    let whole = folder();
    let (_, _, expected) = told(&whole, &run("tree.swc", &[]));
    let digest = |folder: &Path| fs::read(folder.join("out/SHA256SUMS")).expect("results");
    for (command, stream) in
        [("\"$@\" 2>&1 >/dev/null | head -n 1", "begin"), ("\"$@\" 2>/dev/null | head -n 1", "{")]
    {
        let folder = folder();
        let output = Command::new("bash")
            .args(["-c", &format!("{command}; exit ${{PIPESTATUS[0]}}"), "bash"])
            .arg(env!("CARGO_BIN_EXE_espalier"))
            .args(run("tree.swc", &["--json"]))
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .output()
            .expect("bash");
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(output.status.code(), Some(0), "{text}");
        assert!(text.contains(stream) && text.lines().count() == 1, "{text}");
        assert_eq!(digest(folder.path()), digest(whole.path()), "{expected}");
    }
}

#[test]
fn people_are_told_more_if_they_ask() {
    let folder = folder();
    let said = |more: &[&'static str]| {
        let said = Said::by(&espalier(folder.path(), &run("tree.swc", more)));
        assert_eq!(said.code, Some(0), "{}", said.error);
        said.error
    };
    let plain = said(&[]);
    assert!(!plain.contains("to do:") && !plain.contains("set  "), "{plain}");
    let more = said(&["-v", "--set", "embed.w_angle=3"]);
    assert!(more.contains("set       embed.w_angle = 3.0 (default 2.0)\n"), "{more}");
    assert!(more.contains("embed     to do: embed.w_angle is 3.0, was 2.0\n"), "{more}");
    assert!(!more.contains("tips 2"), "{more}");
    let most = said(&["-vv", "--force"]);
    assert!(most.contains("tree      to do: asked for\n") && most.contains("tips 2"), "{most}");
    assert!(most.contains("solver ") && most.lines().all(|line| line.chars().count() < 200), "{most}");
}
