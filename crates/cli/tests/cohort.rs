//! Many scans from one table, as their user meets them.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::fs;
use std::path::Path;

use program::{QUICK, Said, espalier, fork, stderr};
use serde_json::Value;

/// Two forks, a mask with a loop that is refused, and a scan that is not there.
fn data() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    let at = folder.path().join("data");
    fs::create_dir(&at).expect("folder");
    fs::write(at.join("one.swc"), fork(20.0)).expect("writable");
    fs::write(at.join("two.swc"), fork(30.0)).expect("writable");
    let torus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/torus.nii.gz");
    fs::copy(torus, at.join("torus.nii.gz")).expect("copied");
    let table = "id\tpath\tinput.unit\ttree.loops\tnote\n\
                 a\tone.swc\tmm\t\tfirst\nb\tlost.swc\tmm\t\t\nc\ttorus.nii.gz\tn/a\trefuse\t\nd\ttwo.swc\tmm\t\t\n";
    fs::write(at.join("samples.tsv"), table).expect("writable");
    folder
}

fn cohort(folder: &Path, arguments: &[&str]) -> Said {
    let output = espalier(folder, &[&["cohort"], arguments, QUICK.as_slice()].concat());
    Said::by(&output)
}

/// The rows of a table without its heading.
fn rows(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path).expect("a table");
    text.lines().skip(1).map(|line| line.split('\t').map(str::to_owned).collect()).collect()
}

fn verdicts(folder: &Path) -> Vec<(String, String)> {
    rows(&folder.join("out/group/group.tsv")).iter().map(|row| (row[0].clone(), row[1].clone())).collect()
}

fn list(folder: &Path, more: &[&str]) -> Vec<Value> {
    let said = cohort(folder, &[&["data/samples.tsv", "-o", "out", "--list"], more].concat());
    assert_eq!(said.code, Some(0), "{}", said.error);
    let list: Value = serde_json::from_str(&said.out).expect("JSON");
    list["samples"].as_array().expect("samples").clone()
}

#[test]
fn a_scan_that_fails_stops_no_other() {
    let folder = data();
    let at = folder.path();
    let call = ["data/samples.tsv", "-o", "out"];
    let first = cohort(at, &call);
    assert_eq!(first.code, Some(74), "{}", first.error);
    assert!(first.error.contains("error[E-COHORT-FAILED]: 2 of 4 scans failed; the first: b (E-IO-READ)"));
    assert!(first.out.contains("4 runs, 2 certified, 2 without a map"), "{}", first.out);
    let expected = [("a", "certified"), ("b", "failed"), ("c", "failed"), ("d", "certified")];
    assert_eq!(verdicts(at), expected.map(|(id, verdict)| (id.to_owned(), verdict.to_owned())));
    let failures = rows(&at.join("out/failures.tsv"));
    let told = |row: &[String]| (row[0].clone(), row[1].clone(), row[3].clone());
    assert_eq!(told(&failures[0]), ("b".to_owned(), "E-IO-READ".to_owned(), "n/a".to_owned()));
    assert_eq!(failures[0][2], "a file cannot be read");
    assert!(failures[1][1].starts_with("E-TREE") && failures[1][2].starts_with("tree: "), "{failures:?}");
    assert_eq!(failures[1][3], "radius");

    // The same command looks at what is done, and does the rest.
    let second = cohort(at, &call);
    assert_eq!(
        (second.code, second.error.matches("embed        kept").count()),
        (Some(74), 2),
        "{}",
        second.error
    );
    let worked = |line: &&str| line.contains(" s  ") && !line.starts_with("in all ");
    assert_eq!(second.error.lines().find(worked), None, "{}", second.error);
    // What the list says is what there is to do.
    fs::write(at.join("data/lost.swc"), fork(40.0)).expect("writable");
    let retry: Vec<&str> = failures[0][4].split(' ').skip(1).collect();
    assert_eq!(retry[..5], ["cohort", "data/samples.tsv", "-o", "out", "--set"]);
    let again = espalier(at, &retry);
    assert!(again.status.success(), "{}", stderr(&again));
    let page = cohort(at, &[&call[..], &["--group"]].concat());
    assert_eq!(page.code, Some(0), "{}", page.error);
    assert!(page.out.contains("4 runs, 3 certified, 1 without a map"), "{}", page.out);
    assert_eq!(rows(&at.join("out/failures.tsv")).len(), 1);

    // Other results in the folder of a scan are not the ones that it was done with.
    fs::write(at.join("out/runs/a/SHA256SUMS"), "others").expect("writable");
    let page = cohort(at, &[&call[..], &["--group"]].concat());
    assert!(page.out.contains("4 runs, 2 certified, 2 without a map"), "{}", page.out);
}

#[test]
fn older_results_are_not_taken_for_new_ones() {
    let folder = data();
    let at = folder.path();
    let only = |id: &str, more: &[&str]| {
        cohort(at, &[&["data/samples.tsv", "-o", "out", "--only", id], more].concat())
    };
    assert_eq!(only("a,d", &[]).code, Some(0));
    let is_done = |more: &[&str]| {
        list(at, more).iter().map(|sample| sample["done"] == Value::Bool(true)).collect::<Vec<_>>()
    };
    assert_eq!(is_done(&[]), [true, false, false, true]);
    assert_eq!(is_done(&["--set", "embed.w_angle=7"]), [false; 4]);
    // The scan is damaged afterwards: its map is not that of the scan.
    fs::write(at.join("data/one.swc"), "1 1 0 0\n").expect("writable");
    let refused = only("a", &[]);
    assert_eq!(refused.code, Some(3), "{}", refused.error);
    assert!(at.join("out/runs/a/embedding.json").exists());
    let page = cohort(at, &["data/samples.tsv", "-o", "out", "--group"]);
    assert_eq!(page.code, Some(0), "{}", page.error);
    let failures = rows(&at.join("out/failures.tsv"));
    assert_eq!(failures.iter().map(|row| row[0].as_str()).collect::<Vec<_>>(), ["a", "b", "c"]);
    assert!(failures[0][1].starts_with("E-SWC"), "{failures:?}");
    assert_eq!((failures[1][1].as_str(), failures[1][2].contains("never run")), ("E-GROUP-NO-RUN", true));
    // A page over folders sees the note as well.
    assert_eq!(espalier(at, &["group", "out/runs", "-o", "page"]).status.code(), Some(0));
    assert_eq!(rows(&at.join("page/group.tsv"))[0][1], "failed");
    // Asked for with other settings, nothing is done any more.
    let page = cohort(at, &["data/samples.tsv", "-o", "out", "--group", "--set", "seed=9"]);
    assert!(page.out.contains("4 runs, 0 certified, 4 without a map"), "{}", page.out);
    assert!(
        page.out.contains("d  E-GROUP-UNFINISHED  done before, but not with these settings"),
        "{}",
        page.out
    );
}

#[test]
fn a_list_says_what_each_scan_depends_on() {
    let folder = data();
    let at = folder.path();
    fs::write(at.join("data/quick.toml"), "schema = 1\n[embed]\nw_angle = 7.0\n").expect("writable");
    let before = list(at, &["--config", "data/quick.toml"]);
    let files = |sample: &Value| sample["files"].as_array().expect("files").len();
    assert_eq!(before.iter().map(files).collect::<Vec<_>>(), [2, 1, 2, 2]);
    assert_eq!(before[0]["done_file"], "out/runs/a/provenance/sample.json");
    let text = fs::read_to_string(at.join("data/samples.tsv")).expect("a table");
    fs::write(at.join("data/samples.tsv"), text.replace("two.swc", "one.swc")).expect("writable");
    let after = list(at, &["--config", "data/quick.toml"]);
    let settings = |list: &[Value]| list.iter().map(|sample| sample["settings"].clone()).collect::<Vec<_>>();
    assert_eq!(settings(&before)[..3], settings(&after)[..3]);
    assert_ne!(before[3]["settings"], after[3]["settings"]);
    assert_ne!(settings(&before)[0], list(at, &[])[0]["settings"]);
    assert!(!at.join("out").exists(), "a list writes nothing");
}

#[test]
fn a_table_that_cannot_be_used_is_refused_whole() {
    let folder = data();
    let at = folder.path();
    fs::write(at.join("data/config.txt"), "bogus = 1\n").expect("writable");
    for (table, parts) in [
        ("id\tpath\tlable\na\tx.swc\t3\n", vec!["line 1: unknown column lable; did you mean label?"]),
        (
            "id\tpath\tembed.w_angel\tconfig\na\tone.swc\t3\t\nb\tone.swc\t\tnone.toml\n",
            vec!["line 2: a: ", "embed.w_angel", "line 3: b: cannot read data/none.toml"],
        ),
        ("id\tpath\tembed.w_angle\na\tone.swc\t-3\na\tone.swc\t\n", vec!["line 3: id a is that of line 2"]),
        ("id\tpath\tpreset\na\tone.swc\tliver\n", vec!["line 2: a: ", "preset"]),
        ("id\tpath\na\t$ESPALIER_DATA/x.nii\n", vec!["ESPALIER_DATA is not set"]),
        ("id\tpath\tconfig\na\tone.swc\tconfig.txt\n", vec!["line 2: a: ", "bogus"]),
    ] {
        fs::write(at.join("data/samples.tsv"), table).expect("writable");
        let said = cohort(at, &["data/samples.tsv", "-o", "out"]);
        assert_eq!(said.code, Some(2), "{table}: {}", said.error);
        assert!(said.error.contains("error[E-COHORT-TABLE]: data/samples.tsv: "), "{}", said.error);
        for part in parts {
            assert!(said.error.contains(part), "no {part:?} in {}", said.error);
        }
    }
    assert_eq!(cohort(at, &["data/none.tsv"]).code, Some(74));
    fs::write(at.join("data/samples.tsv"), "id\tpath\na\tone.swc\n").expect("writable");
    let said = cohort(at, &["data/samples.tsv", "-o", "out", "--only", "z"]);
    assert_eq!(
        (said.code, said.error.contains("error[E-COHORT-NO-SCAN]: there is no scan z")),
        (Some(2), true)
    );
    assert!(!at.join("out").exists());
}

#[test]
fn no_path_of_the_machine_is_on_the_page() {
    let folder = data();
    let at = folder.path();
    let (table, out) = (at.join("data/samples.tsv"), at.join("out"));
    let call = [table.to_str().expect("UTF-8"), "-o", out.to_str().expect("UTF-8"), "--anonymous"];
    assert_eq!(cohort(at, &call).code, Some(74));
    for file in ["group.html", "group.json", "group.tsv"] {
        let text = fs::read_to_string(out.join("group").join(file)).expect("a file");
        assert!(
            !text.contains("espalier run") && !text.contains("espalier cohort"),
            "{file}: a command has the scan's name"
        );
    }
    let named = cohort(at, &[&call[..3], &["--group"]].concat());
    assert_eq!(named.code, Some(0));
    let page = fs::read_to_string(out.join("group/group.html")).expect("a page");
    assert!(page.contains("espalier cohort samples.tsv -o out "), "the command as a page may show it");
    for file in ["group.html", "group.json", "group.tsv"] {
        let text = fs::read_to_string(out.join("group").join(file)).expect("a file");
        assert!(!text.contains(&at.display().to_string()), "{file}");
    }
    assert!(rows(&out.join("failures.tsv"))[0][4].contains(&table.display().to_string()));
}

#[test]
fn a_result_that_is_gone_or_cut_is_not_done() {
    let folder = data();
    let at = folder.path();
    assert_eq!(cohort(at, &["data/samples.tsv", "-o", "out", "--only", "a,d"]).code, Some(0));
    let done = |file: &str| {
        let text = fs::read_to_string(at.join("out/runs/a").join(file)).expect("a result");
        let is_done = || list(at, &[])[0]["done"] == Value::Bool(true);
        assert!(is_done(), "{file}");
        fs::write(at.join("out/runs/a").join(file), &text[..text.len() / 2]).expect("writable");
        let is_done_cut = is_done();
        fs::remove_file(at.join("out/runs/a").join(file)).expect("removed");
        let is_done_without = is_done();
        assert_eq!(list(at, &[])[0]["altered"], Value::Bool(true));
        assert_eq!(
            list(at, &["--set", "seed=9"])[0]["altered"],
            Value::Bool(false),
            "other settings are no damage"
        );
        let page = cohort(at, &["data/samples.tsv", "-o", "out", "--group"]);
        assert!(page.out.contains(&format!("done before, but {file} is gone since")), "{}", page.out);
        fs::write(at.join("out/runs/a").join(file), text).expect("writable");
        (is_done_cut, is_done_without)
    };
    for file in ["nodes.tsv", "planar.svg", "stages/07-render/report.json"] {
        assert_eq!(done(file), (false, false), "{file}");
    }
    fs::remove_file(at.join("out/runs/a/planar.svg")).expect("removed");
    let again = cohort(at, &["data/samples.tsv", "-o", "out", "--only", "a,d"]);
    assert_eq!(again.code, Some(0), "{}", again.error);
    assert!(again.error.contains("embed        kept") && at.join("out/runs/a/planar.svg").exists());
    assert_eq!(list(at, &["--only", "a"])[0]["done"], Value::Bool(true));
}

#[test]
fn of_two_calls_at_once_one_goes_on() {
    let folder = data();
    let at = folder.path();
    let table = "id\tpath\tinput.unit\na\tone.swc\tmm\nb\ttwo.swc\tmm\nc\tone.swc\tmm\n";
    fs::write(at.join("data/samples.tsv"), table).expect("writable");
    let call = |more: &[&str]| cohort(at, &[&["data/samples.tsv", "-o", "out"], more].concat());
    let both = |more: &[&str]| {
        let codes: Vec<Option<i32>> = std::thread::scope(|scope| {
            let calls = [scope.spawn(|| call(more)), scope.spawn(|| call(more))];
            calls.into_iter().map(|call| call.join().expect("a thread").code).collect()
        });
        fs::remove_dir_all(at.join("out")).expect("removed");
        codes
    };
    assert_eq!(both(&["--wait"]), [Some(0), Some(0)]);
    // The second may begin when the first is done.
    let codes = both(&[]);
    assert!(
        codes.contains(&Some(0)) && codes.iter().all(|code| [Some(0), Some(75)].contains(code)),
        "{codes:?}"
    );
    // Somebody holds the folder, as a call that does all scans would.
    fs::create_dir(at.join("out")).expect("folder");
    let lock = fs::File::create(at.join("out/.lock")).expect("a file");
    lock.lock().expect("a lock");
    let refused = call(&[]);
    assert_eq!(refused.code, Some(75), "{}", refused.error);
    assert!(
        refused.error.contains("error[E-RUN-LOCKED]: another run is at work in out"),
        "{}",
        refused.error
    );
    // One scan alone, a list, a page: none of them is in the way.
    for more in [&["--only", "b"][..], &["--list"], &["--group"]] {
        assert_eq!(call(more).code, Some(0), "{more:?}");
    }
}

#[test]
fn the_same_table_elsewhere_has_the_same_scans() {
    let folder = data();
    let at = folder.path();
    let table = "id\tpath\tinput.unit\tembed.edits\na\tone.swc\tmm\tedits.json\nb\ttwo.swc\tmm\t\n";
    fs::write(at.join("data/samples.tsv"), table).expect("writable");
    fs::create_dir(at.join("other")).expect("folder");
    fs::rename(at.join("data"), at.join("other/moved")).expect("moved");
    let settings = |table: &str, more: &[&str]| {
        let said = cohort(at, &[&[table, "-o", "out", "--list"], more].concat());
        assert_eq!(said.code, Some(0), "{}", said.error);
        let list: Value = serde_json::from_str(&said.out).expect("JSON");
        let samples = list["samples"].as_array().expect("samples").clone();
        samples.iter().map(|sample| sample["settings"].clone()).collect::<Vec<_>>()
    };
    let moved = settings("other/moved/samples.tsv", &[]);
    let named = settings("other/moved/samples.tsv", &["--image", "other/moved/ct.nii"]);
    fs::rename(at.join("other/moved"), at.join("data")).expect("moved");
    assert_eq!(settings("data/samples.tsv", &[]), moved);
    assert_eq!(settings("data/samples.tsv", &["--image", "data/ct.nii"]), named);
    assert_ne!(settings("data/samples.tsv", &["--image", "data/other.nii"]), named);
    fs::write(at.join("data/samples.tsv"), table.replace("edits.json", "others.json")).expect("writable");
    let other = settings("data/samples.tsv", &[]);
    assert!(other[0] != moved[0] && other[1] == moved[1], "another file beside is another scan");
}

#[test]
fn a_call_for_one_scan_reads_its_own_config_alone() {
    let folder = data();
    let at = folder.path();
    fs::write(at.join("data/good.toml"), "schema = 1\n[input]\nunit = \"mm\"\n").expect("writable");
    fs::write(at.join("data/bad.toml"), "schema = 1\nbogus = 1\n").expect("writable");
    let table = "id\tpath\tconfig\na\tone.swc\tgood.toml\nb\ttwo.swc\tbad.toml\n";
    fs::write(at.join("data/samples.tsv"), table).expect("writable");
    let call = |more: &[&str]| cohort(at, &[&["data/samples.tsv", "-o", "out"], more].concat());
    let whole = call(&["--list"]);
    assert_eq!(whole.code, Some(2), "{}", whole.error);
    assert_eq!(list(at, &["--only", "a"]).len(), 1);
    let only = call(&["--only", "a"]);
    assert_eq!(only.code, Some(0), "{}", only.error);
    assert_eq!(call(&["--only", "b"]).code, Some(2));
}

#[test]
fn a_problem_of_the_table_comes_with_its_way_out_and_a_retry_with_its_options() {
    let folder = data();
    let at = folder.path();
    fs::write(at.join("data/lost.tsv"), "id\tpath\na\t$ESPALIER_DATA/x.nii\n").expect("writable");
    let said = cohort(at, &["data/lost.tsv", "-o", "out"]);
    assert!(said.error.contains("\n    hint: set it to the folder of the data"), "{}", said.error);

    let options = ["--threads", "2", "--max-memory", "2G", "--cache", "a store", "--wait"];
    let said = cohort(at, &[&["data/samples.tsv", "-o", "out", "--only", "b"][..], &options].concat());
    assert_eq!(said.code, Some(74), "{}", said.error);
    let page = cohort(at, &[&["data/samples.tsv", "-o", "out", "--group"][..], &options].concat());
    assert_eq!(page.code, Some(0), "{}", page.error);
    let retry = &rows(&at.join("out/failures.tsv"))[1][4];
    let expected = " --threads 2 --max-memory 2G --cache 'a store' --cache-size 20G --wait --only b";
    assert!(retry.ends_with(expected), "{retry}");
}

#[test]
fn a_page_asked_for_with_other_settings_says_so() {
    let folder = data();
    let at = folder.path();
    assert_eq!(cohort(at, &["data/samples.tsv", "-o", "out", "--only", "a,d"]).code, Some(0));
    let page = cohort(at, &["data/samples.tsv", "-o", "out", "--group", "--set", "seed=9"]);
    assert!(
        page.error.contains("note: scans that were done with other settings, and do not count: 2;"),
        "{}",
        page.error
    );
    let page = cohort(at, &["data/samples.tsv", "-o", "out", "--group"]);
    assert!(!page.error.contains("other settings"), "{}", page.error);
}

/// What pipelines/cohort calls is what there is; whether Snakemake runs it, `scripts/cohort` tells.
#[test]
fn the_snakefile_asks_for_what_there_is() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let snakefile = fs::read_to_string(root.join("pipelines/cohort/Snakefile")).expect("a Snakefile");
    let help = espalier(&root, &["cohort", "--help"]);
    let help = String::from_utf8_lossy(&help.stdout).into_owned();
    let calls: Vec<&str> = snakefile.lines().filter(|line| line.contains("COHORT}")).collect();
    let words = calls.iter().flat_map(|line| line.split_whitespace());
    let options: Vec<&str> =
        words.map(|word| word.trim_matches(['"', ',', ')'])).filter(|word| word.starts_with("--")).collect();
    assert!(options.len() >= 5, "{options:?}");
    for option in options {
        assert!(help.contains(option), "{option}");
    }
    let config = fs::read_to_string(root.join("pipelines/cohort/config.yaml")).expect("a config");
    let keys: Vec<&str> =
        config.lines().filter_map(|line| line.split_once(':')).map(|(key, _)| key).collect();
    for key in snakefile
        .split("config['")
        .chain(snakefile.split("config[\""))
        .filter_map(|rest| rest.split(['\'', '"']).next())
    {
        let is_key = key.chars().all(|c| c.is_ascii_lowercase() || c == '_');
        assert!(!is_key || keys.contains(&key), "{key}");
    }
    let out = tempfile::tempdir().expect("temporary folder");
    let out = out.path().to_str().expect("UTF-8");
    let listed = espalier(&root, &["cohort", "pipelines/cohort/samples.tsv", "-o", out, "--list"]);
    let list: Value = serde_json::from_slice(&listed.stdout).expect("JSON");
    assert_eq!(list["samples"].as_array().map(Vec::len), Some(3), "{}", stderr(&listed));
    for key in ["id", "files", "settings", "done_file", "altered"] {
        assert!(list["samples"][0].get(key).is_some(), "{key}");
    }
    assert!(snakefile.contains("/provenance/sample.json"), "the file that says that a scan is done");
}
