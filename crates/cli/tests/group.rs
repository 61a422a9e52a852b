//! A page over many runs, as its user meets it.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::fs;
use std::path::Path;

use program::{QUICK, espalier, fork, stderr};

/// A name that no page may have.
const PATIENT: &str = "DOEJANE19470813";

fn run(folder: &Path, input: &str, out: &str, more: &[&str]) -> Option<i32> {
    let set = ["--set", "input.unit=mm"];
    let output = espalier(folder, &[["run", input, "-o", out, "-q"].as_slice(), &set, &QUICK, more].concat());
    output.status.code()
}

fn group(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = espalier(folder, &[&["group"], arguments].concat());
    (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned(), stderr(&output))
}

/// A cell of `group.tsv`, by label and column.
fn cell(folder: &Path, out: &str, label: &str, column: &str) -> String {
    let table = fs::read_to_string(folder.join(out).join("group.tsv")).expect("a table");
    let mut rows = table.lines().map(|line| line.split('\t').collect::<Vec<_>>());
    let heads = rows.next().expect("heads");
    let index = heads.iter().position(|head| *head == column).expect("a column");
    rows.find(|row| row[0] == label).map_or_else(String::new, |row| row[index].to_owned())
}

/// Six like runs, one ten times as long, one that failed, one that ended early, one that was altered, one of an older
/// format, and what is no run.
fn cohort() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    let at = folder.path();
    for (i, length_mm) in [20.0, 21.0, 22.0, 20.5, 21.5, 22.5, 400.0].into_iter().enumerate() {
        fs::write(at.join("tree.swc"), fork(length_mm)).expect("writable");
        assert_eq!(run(at, "tree.swc", &format!("cohort/case-{i}"), &[]), Some(0));
    }
    fs::write(at.join("tree.swc"), fork(20.0)).expect("writable");
    assert_eq!(run(at, "tree.swc", "cohort/early", &["--to", "views"]), Some(0));
    let torus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/torus.nii.gz");
    fs::copy(torus, at.join(format!("{PATIENT}.nii.gz"))).expect("copied");
    let refuse = ["--set", "tree.loops=refuse"];
    assert_eq!(run(at, &format!("{PATIENT}.nii.gz"), "cohort/refused", &refuse), Some(6));

    for copy in ["altered", "older"] {
        assert_eq!(run(at, "tree.swc", &format!("cohort/{copy}"), &[]), Some(0));
    }
    let embedding = |copy: &str| at.join("cohort").join(copy).join("embedding.json");
    fs::write(embedding("altered"), "{}").expect("writable");
    let text = fs::read_to_string(embedding("older")).expect("readable");
    fs::write(embedding("older"), text.replacen("\"version\":3", "\"version\":1", 1)).expect("writable");
    // Nothing vouches for it, as in a folder that somebody has put together.
    fs::remove_file(at.join("cohort/older/SHA256SUMS")).expect("removed");
    fs::create_dir(at.join("cohort/notes")).expect("folder");
    folder
}

#[test]
fn runs_are_shown_with_what_stands_out_and_what_failed() {
    let folder = cohort();
    let at = folder.path();
    let (code, out, error) = group(at, &["cohort", "cohort/case-0/", "-o", "page"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(out.starts_with("11 runs, 7 certified, 4 without a map, 1 with outliers\n"), "{out}");
    assert!(error.contains("cohort/case-0/ was given twice and is shown once"), "{error}");
    let of = |label: &str, column: &str| cell(at, "page", label, column);
    assert!(of("case-6", "outliers").contains("total_length_mm"));
    assert_eq!((of("case-0", "verdict"), of("case-0", "tips")), ("certified".to_owned(), "2".to_owned()));
    assert_eq!(
        (of("early", "code"), of("early", "done_to")),
        ("E-GROUP-UNFINISHED".to_owned(), "views".to_owned())
    );
    assert_eq!(
        (of("altered", "code"), of("older", "code")),
        ("E-RUN-ALTERED-FILE".to_owned(), "E-FILE-VERSION".to_owned())
    );
    assert_eq!((of("refused", "done_to"), of("refused", "tips")), ("radius".to_owned(), "n/a".to_owned()));
    assert!(of("refused", "code").starts_with("E-TREE"), "{}", of("refused", "code"));

    let page = fs::read_to_string(at.join("page/group.html")).expect("a page");
    for said in [
        "espalier embed early &amp;&amp; espalier render early &amp;&amp; espalier report early",
        "espalier tree refused &amp;&amp; ",
        "format espalier-embedding version 1, expected",
        "embedding.json is not what the run's SHA256SUMS says",
        "data:image/png;base64,",
    ] {
        assert!(page.contains(said), "{said}");
    }
    assert!(!page.contains(PATIENT) && !page.contains(&at.display().to_string()));
    assert!(!page.contains("http://") && !page.contains("https://"));
    // What the page says is what there is to do.
    for stage in ["embed", "render", "report"] {
        let output = espalier(&at.join("cohort"), &[&[stage, "early"], QUICK.as_slice()].concat());
        assert!(output.status.success(), "{stage}: {}", stderr(&output));
    }
    // The run that is done now has the tree of the first.
    let (code, out, _) = group(at, &["cohort", "-o", "again", "--threads", "1"]);
    assert_eq!(code, Some(0));
    assert!(
        out.starts_with("11 runs, 8 certified, 3 without a map, 1 with outliers, 2 of equal inputs"),
        "{out}"
    );
    assert_eq!(cell(at, "again", "early", "equal_to"), "case-0");
}

#[test]
fn the_same_runs_make_the_same_page_whoever_asks() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let at = folder.path();
    for i in 0..3 {
        fs::write(at.join("tree.swc"), fork(20.0 + f64::from(i))).expect("writable");
        assert_eq!(run(at, "tree.swc", &format!("x/a/{i}"), &[]), Some(0));
    }
    let digest = |out: String| out.lines().last().expect("a digest").to_owned();
    let first = digest(group(at, &["x/a", "-o", "one", "--threads", "1"]).1);
    let absolute = at.join("x/a").display().to_string();
    for given in [["./x/a/"].as_slice(), &[&absolute], &["x/a/0", "x/a/1", "x/a/2"]] {
        let (code, out, error) = group(at, &[given, &["-o", "two", "--threads", "4"]].concat());
        assert_eq!((code, digest(out)), (Some(0), first.clone()), "{error}");
    }
    let alone = group(at, &["x/a/1", "-o", "three"]);
    assert!(alone.0 == Some(0) && alone.1.starts_with("1 run, 1 certified"), "{alone:?}");
    let page = fs::read_to_string(at.join("three/group.html")).expect("a page");
    assert!(page.contains("too few to say what is usual"));
    let hidden = group(at, &["x/a", "nowhere", "--anonymous", "--title", "<i>A & B", "-o", "four"]);
    assert_eq!(hidden.0, Some(0));
    assert_eq!(cell(at, "four", "run-4", "code"), "E-GROUP-NO-RUN");
    let page = fs::read_to_string(at.join("four/group.html")).expect("a page");
    assert!(page.contains("<h1>&lt;i&gt;A &amp; B</h1>"));

    fs::create_dir(at.join("empty")).expect("folder");
    for (given, out, expected) in
        [("empty", "five", 74), ("nowhere", "five", 74), ("tree.swc", "five", 74), ("x/a/0", "x/a/1", 2)]
    {
        let (code, _, error) = group(at, &[given, "-o", out]);
        assert_eq!(code, Some(expected), "{given}: {error}");
    }
    assert!(!at.join("five").exists());
}
