use super::*;

fn measured(i: usize) -> Measured {
    Measured {
        branches: 40 + i % 3,
        tips: 20 + i % 2,
        total_length_mm: 900.0 + 7.0 * (i % 5) as f64,
        radius_mean_mm: 2.0 + 0.03 * (i % 4) as f64,
        generation_max: 7,
        length_loss_mean: 0.0,
        angle_loss_mean: 0.01,
        angle3d_error_mean_deg: 1.0 + 0.1 * (i % 3) as f64,
        energy: 5.0,
        crossings: 0,
        overlaps: i % 2,
        warnings: 0,
        loops_cut: 0,
        spurs_pruned: 3,
        narrow_places: 0,
        voxel_mm: [0.7, 0.7, 1.0],
    }
}

fn mapped(label: &str, measured: Measured, input: &str) -> GroupRun {
    GroupRun {
        label: label.to_owned(),
        outcome: GroupOutcome::Mapped(Box::new(Mapped {
            measured,
            thumbnail_png: b"\x89PNG".to_vec(),
            side_mm: 100.0,
            inputs: vec![input.to_owned()],
            tree: format!("tree of {input}"),
            settings: BTreeMap::from([("tree.spur_factor".to_owned(), "1.0".to_owned())]),
        })),
    }
}

fn failed(label: &str) -> GroupRun {
    GroupRun {
        label: label.to_owned(),
        outcome: GroupOutcome::Failed(Failed {
            code: "E-SKELETON-EMPTY".to_owned(),
            reason: "<b>nothing</b> is left".to_owned(),
            done_to: Some("volume".to_owned()),
            retry: Some("espalier skeleton \"a run\" && espalier radius \"a run\"".to_owned()),
        }),
    }
}

/// Twelve runs with an outlier, a failure, a crossing, two of one input and one with another setting.
fn cohort() -> Vec<GroupRun> {
    let mut runs: Vec<GroupRun> =
        (0..12).map(|i| mapped(&format!("case-{i:02}"), measured(i), &format!("input {i}"))).collect();
    let change = |run: &mut GroupRun, change: fn(&mut Mapped)| {
        if let GroupOutcome::Mapped(mapped) = &mut run.outcome {
            change(mapped);
        }
    };
    change(&mut runs[4], |mapped| mapped.measured.total_length_mm = 90.0);
    change(&mut runs[5], |mapped| mapped.measured.crossings = 2);
    change(&mut runs[7], |mapped| mapped.inputs = vec!["input 2".to_owned()]);
    change(&mut runs[8], |mapped| {
        mapped.settings.insert("tree.spur_factor".to_owned(), "2.0".to_owned());
    });
    runs[9] = failed("case-09 <script>");
    runs
}

#[test]
fn what_stands_out_is_said() {
    let runs = cohort();
    let made = group("a cohort", &runs);
    assert_eq!(
        made.summary,
        "12 runs, 10 certified, 1 with crossings, 1 without a map, 2 with outliers, 2 of equal inputs"
    );
    let rows: Vec<Vec<&str>> = made.tsv.lines().map(|line| line.split('\t').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|head| *head == name).expect("a column");
    let cell = |run: usize, name: &str| rows[run + 1][column(name)];
    assert!(rows.iter().all(|row| row.len() == rows[0].len()));
    assert_eq!(cell(4, "outliers"), "total_length_mm");
    assert_eq!((cell(5, "verdict"), cell(5, "outliers")), ("crosses", "crossings"));
    assert_eq!(
        (cell(2, "equal_to"), cell(7, "equal_to"), cell(3, "equal_to")),
        ("case-02", "case-02", "n/a")
    );
    assert_eq!(
        (cell(9, "verdict"), cell(9, "code"), cell(9, "branches")),
        ("failed", "E-SKELETON-EMPTY", "n/a")
    );
    assert_eq!(made.dictionary.lines().count(), rows[0].len() + 1);

    for said in [
        "✗ 12 runs, 10 certified",
        "total_length_mm: ",
        "espalier skeleton &quot;a run&quot; &amp;&amp; espalier radius",
        "&lt;b&gt;nothing&lt;/b&gt;",
        "tree.spur_factor",
        "(case-08)",
        "0.7 × 0.7 × 1",
    ] {
        assert!(made.html.contains(said), "{said}");
    }
    assert!(!made.html.contains("<b>nothing") && !made.html.contains("case-09 <script>"));
    let json: serde_json::Value = serde_json::from_str(&made.json).expect("JSON");
    assert_eq!((&json["format"], &json["version"]), (&"espalier-group".into(), &1.into()));
    assert_eq!(json["runs"][4]["outliers"][0]["name"], "total_length_mm");
    assert_eq!(json["runs"][9]["done_to"], "volume");
    assert_eq!(json["measures"][2]["n"], 11);
}

/// Whether no number on the page is none; scripts and style may speak of such.
fn is_clean(html: &str) -> bool {
    let body =
        html.split("</style>").last().and_then(|rest| rest.split("<script").next()).unwrap_or_default();
    body.len() > 1000 && !body.contains("NaN") && !body.contains(">inf") && !body.contains("\"inf")
}

#[test]
fn groups_of_any_size_have_a_page() {
    for n in [0, 1, 2, 4] {
        let mut runs = cohort();
        runs.truncate(n);
        let made = group("few", &runs);
        assert!(made.html.contains("too few to say what is usual"), "{n}");
        assert!(is_clean(&made.html), "{n}");
    }
    let only_failed = group("none", &[failed("a"), failed("b")]);
    assert!(only_failed.html.contains("No run has a map.") && is_clean(&only_failed.html));
    let equal: Vec<GroupRun> =
        (0..9).map(|i| mapped(&format!("{i}"), measured(0), &format!("{i}"))).collect();
    assert!(group("equal", &equal).html.contains("all 9 runs: 40"));
    let odd =
        Measured { total_length_mm: f64::INFINITY, energy: f64::NAN, voxel_mm: [f64::NAN; 3], ..measured(0) };
    let odd: Vec<GroupRun> = (0..6).map(|i| mapped("odd", odd.clone(), &format!("{i}"))).collect();
    assert!(is_clean(&group("odd", &odd).html));
}

#[test]
fn style_and_script_ask_for_nothing() {
    for text in [GROUP_CSS, GROUP_JS] {
        for forbidden in ["http", "url(", "@import", "fetch(", "XMLHttp", "eval(", "innerHTML", "</"] {
            assert!(!text.contains(forbidden), "{forbidden}");
        }
    }
}

#[test]
fn a_thousand_runs_make_a_page_in_proportion() {
    let runs: Vec<GroupRun> =
        (0..1000).map(|i| mapped(&format!("case-{i:04}"), measured(i), &format!("{i}"))).collect();
    let n_bytes = group("many", &runs).html.len();
    // Numbers and beads; the pictures come on top.
    assert!(n_bytes < 4_000_000, "{n_bytes}");
}
