//! From the scan to the map and back, as its user meets it.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use program::espalier;
use serde_json::Value;
use tempfile::TempDir;

fn text_of(folder: &Path, arguments: &[&str]) -> String {
    let output = espalier(folder, arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {errors}");
    String::from_utf8(output.stdout).expect("text")
}

fn points_of(folder: &Path, arguments: &[&str]) -> Vec<Value> {
    let json = text_of(folder, &[&["locate", "run", "--json"], arguments].concat());
    let file: Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(file["format"], "espalier-located");
    file["points"].as_array().expect("points").clone()
}

/// The run of a mask of a fork.
fn run_of_y() -> TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    text_of(folder.path(), &["phantom", "y", "-o", "y"]);
    let quick = ["embed.pso.particles=16", "embed.pso.iterations=4", "render.width_px=400"];
    let quick: Vec<&str> = quick.iter().flat_map(|set| ["--set", set]).collect();
    text_of(folder.path(), &[&["run", "y/truth-mask.nii.gz", "-o", "run"], quick.as_slice()].concat());
    folder
}

/// The columns of `nodes.tsv`, as numbers where they are.
fn nodes(folder: &Path) -> Vec<Vec<f64>> {
    let table = fs::read_to_string(folder.join("run/nodes.tsv")).expect("nodes.tsv");
    assert!(table.starts_with("node\tparent\tx_mm\ty_mm\tz_mm\tradius_mm\tu_mm\tv_mm\tbranch\tgeneration\t"));
    let numbers = |line: &str| line.split('\t').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
    table.lines().skip(1).map(numbers).collect()
}

fn number(point: &Value, name: &str) -> f64 {
    point[name].as_f64().unwrap_or(f64::NAN)
}

#[test]
fn every_node_is_where_the_layout_has_it_and_back() {
    let folder = run_of_y();
    let nodes = nodes(folder.path());
    let table = |columns: &[usize]| {
        let row =
            |node: &Vec<f64>| columns.iter().map(|&i| node[i].to_string()).collect::<Vec<_>>().join("\t");
        "# nodes\n".to_owned() + &nodes.iter().map(row).collect::<Vec<_>>().join("\n")
    };
    for (file, columns) in [("in-space.tsv", [2, 3, 4].as_slice()), ("on-map.tsv", &[6, 7])] {
        fs::write(folder.path().join(file), table(columns)).expect("write");
        let points = points_of(folder.path(), &["--from", file]);
        assert_eq!(points.len(), nodes.len());
        for (point, node) in points.iter().zip(&nodes) {
            let expected =
                [("x_mm", 2), ("y_mm", 3), ("z_mm", 4), ("u_mm", 6), ("v_mm", 7), ("radius_mm", 5)];
            for (name, column) in expected {
                let found = number(point, name);
                assert!((found - node[column]).abs() < 2e-4, "{file} {name}: {found} {node:?}");
            }
            assert!(number(point, "off_center_mm") < 2e-4 && point["where"] == "inside", "{point}");
            // A fork belongs to all of its branches.
            if number(point, "node") == node[0] {
                assert_eq!(number(point, "branch"), node[8], "{point}");
            }
        }
    }
}

#[test]
fn spaces_are_the_same_point_under_other_names() {
    let folder = run_of_y();
    let [x, y, z] = [2, 3, 4].map(|i| nodes(folder.path())[3][i]);
    let aside = format!("{},{},{}", x + 0.4, y - 0.3, z);
    let ras = &points_of(folder.path(), &[&aside])[0];
    let same = |arguments: &[&str]| {
        let other = &points_of(folder.path(), arguments)[0];
        for name in
            ["x_mm", "y_mm", "z_mm", "u_mm", "v_mm", "pixel_x", "branch", "from_root_mm", "off_center_mm"]
        {
            let (a, b) = (number(ras, name), number(other, name));
            // Voxels and pixels are written with two decimals.
            assert!((a - b).abs() < 0.02, "{arguments:?} {name} {a} {b}");
        }
    };
    assert!((number(ras, "off_center_mm") - 0.5).abs() < 0.15, "{ras}");
    same(&[&format!("{},{},{}", -(x + 0.4), -(y - 0.3), z), "--lps"]);
    same(&[&format!("{},{},{}", ras["i"], ras["j"], ras["k"]), "--voxel"]);
    // On the map the same point, but for what it lies off the surface that the map shows.
    for (arguments, names) in
        [(["--json"].as_slice(), ["u_mm", "v_mm"]), (&["--pixel"], ["pixel_x", "pixel_y"])]
    {
        let given = format!("{},{}", ras[names[0]], ras[names[1]]);
        let run = [&["locate", "run", &given], arguments, &["--json"]].concat();
        let json = if arguments == ["--json"] { &run[..4] } else { &run[..] };
        let back: Value = serde_json::from_str(&text_of(folder.path(), json)).expect("JSON");
        let back = &back["points"][0];
        assert_eq!(back["branch"], ras["branch"]);
        let off = ["x_mm", "y_mm", "z_mm"].map(|name| number(ras, name) - number(back, name));
        let off = off.iter().map(|d| d * d).sum::<f64>().sqrt();
        assert!((off - number(ras, "out_of_plane_mm").abs()).abs() < 0.03, "{off} {ras} {back}");
    }
}

#[test]
fn what_is_outside_is_said_to_be() {
    let folder = run_of_y();
    let point = &points_of(folder.path(), &["900,0,0"])[0];
    assert_eq!((point["where"].as_str(), point["in_mask"].as_str()), (Some("outside"), Some("beyond")));
    assert!(number(point, "beyond_mm") > 500.0 && point["branch"].is_number(), "{point}");
    let text = text_of(folder.path(), &["locate", "run", "-900.5,0"]);
    assert!(text.contains("outside") && text.contains("plane mm") && text.contains("u_mm"), "{text}");
    let text = text_of(folder.path(), &["locate", "run", "0,0,0", "1,1"]);
    assert_eq!(
        (text.lines().count(), text.lines().next().map(|line| line.starts_with("given\t"))),
        (3, Some(true))
    );
}

#[test]
fn what_is_no_point_is_refused() {
    let folder = run_of_y();
    let refused = |arguments: &[&str], input: &str, code: i32, fragment: &str| {
        let mut child = Command::new(env!("CARGO_BIN_EXE_espalier"))
            .args([&["locate"], arguments].concat())
            .current_dir(folder.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        // A program that has seen enough may be gone already.
        let _ = child.stdin.take().expect("an input").write_all(input.as_bytes());
        let output = child.wait_with_output().expect("an end");
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {errors}");
        assert!(errors.contains(fragment) && output.stdout.is_empty(), "{errors}");
    };
    refused(&["run"], "", 2, "required");
    refused(&["run", "1,2,x"], "", 2, "error[E-LOCATE-POINT]");
    refused(&["run", "-1,2,nan"], "", 2, "not finite");
    refused(&["run", "1,2,3,4"], "", 2, "two or three");
    refused(&["run", "1,2,3", "--lps", "--voxel"], "", 2, "cannot be used with");
    refused(&["run", "--from", "-"], "1 2 3\n4 5 six\n", 3, "standard input: line 2");
    refused(&["run", "--from", "-"], "# nothing\n", 3, "no point");
    refused(&["run", "--from", "nowhere.tsv"], "", 74, "nowhere.tsv");
    refused(&["nowhere", "1,2,3"], "", 74, "nowhere");
    fs::write(folder.path().join("ok.swc"), "1 1 0 0 0 1 -1\n2 2 9 0 0 1 1\n").expect("write");
    text_of(folder.path(), &["run", "ok.swc", "-o", "traced"]);
    refused(&["traced", "1,2,3", "--voxel"], "", 2, "error[E-LOCATE-SPACE]");
    fs::write(folder.path().join("traced/tree.swc"), "1 1 0 0 0 1 -1\n2 2 8 0 0 1 1\n").expect("write");
    refused(&["traced", "1,2,3"], "", 8, "SHA256SUMS");
}
