//! Radii up to the wall in the scan: of a run that began with it, and of a mask that is given its scan.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use program::{espalier, stderr};

const N: usize = 40;

/// A file of 1 mm voxels, header and data, with the value at the distance from the axis of a tube along z.
fn write(folder: &Path, name: &str, (offset, element): (&str, &str), value: impl Fn(f64) -> i16) {
    let mut header = String::from("ObjectType = Image\nNDims = 3\n");
    let _ = writeln!(header, "DimSize = {N} {N} {N}\nElementSpacing = 1 1 1\nOffset = {offset}");
    let _ = writeln!(header, "ElementType = {element}\nElementDataFile = {name}.raw");
    let mut data = Vec::new();
    for i in 0..N * N * N {
        let away = |c: usize| c as f64 - 19.3;
        let (x, y, z) = (away(i % N), away(i / N % N), i / N / N);
        let value = if (3..N - 3).contains(&z) { value((x * x + y * y).sqrt()) } else { value(1e3) };
        if element == "MET_UCHAR" { data.push(value as u8) } else { data.extend(value.to_le_bytes()) }
    }
    fs::write(folder.join(format!("{name}.mhd")), header).expect("write");
    fs::write(folder.join(format!("{name}.raw")), data).expect("write");
}

/// From −1000 within a radius to 0 beyond, over two voxels.
fn scan(radius: f64) -> impl Fn(f64) -> i16 {
    move |rho| (1000.0 * (((rho - radius) / 2.0 + 0.5).clamp(0.0, 1.0) - 1.0)) as i16
}

#[test]
fn a_mask_is_given_its_scan_and_a_scan_is_its_own() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let at_origin = ("0 0 0", "MET_SHORT");
    write(folder.path(), "mask", ("0 0 0", "MET_UCHAR"), |rho| i16::from(rho <= 5.0));
    write(folder.path(), "ct", at_origin, scan(6.0));
    write(folder.path(), "wider", at_origin, scan(6.5));
    write(folder.path(), "far", ("900 0 0", "MET_SHORT"), scan(6.0));
    let run = |arguments: &[&str]| {
        let said = espalier(folder.path(), &[arguments, &["--to", "tree"]].concat());
        (said.status.code(), stderr(&said))
    };
    let file = |name: &str| fs::read_to_string(folder.path().join(name)).expect("a file");
    let radius = |out: &str| -> f64 {
        let tree = file(&format!("{out}/tree.swc"));
        let rows = tree.lines().filter(|line| !line.starts_with('#'));
        rows.map(|row| row.split(' ').nth(5).and_then(|r| r.parse().ok()).expect("a radius"))
            .fold(0.0, f64::max)
    };

    // A mask alone ends where it ends.
    let (code, text) = run(&["run", "mask.mhd", "-o", "alone"]);
    assert_eq!(code, Some(0), "{text}");
    assert!((radius("alone") - 5.0).abs() < 0.3 && !text.contains("to the wall"), "{}", radius("alone"));
    let (code, text) = run(&["run", "mask.mhd", "-o", "none", "--set", "radius.wall=scan"]);
    assert!(code == Some(2) && text.contains("E-RADIUS-NO-SCAN") && text.contains("radius.image"), "{text}");
    assert!(!folder.path().join("none").exists());

    // With its scan it ends at the wall, and the record says which scan that was.
    let with =
        |image: &str| run(&["run", "mask.mhd", "-o", "out", "--set", &format!("radius.image={image}")]);
    let (code, text) = with("ct.mhd");
    assert!(code == Some(0) && text.contains("to the wall"), "{text}");
    let first = radius("out");
    assert!((first - 6.0).abs() < 0.25, "{first}");
    assert!(file("out/provenance/inputs.tsv").contains("wall_image\t"));
    let (code, text) = with("ct.mhd");
    assert!(code == Some(0) && text.contains("radius       kept"), "{text}");
    let (code, text) = with("wider.mhd");
    assert!(
        code == Some(0) && text.contains("skeleton     kept") && !text.contains("radius       kept"),
        "{text}"
    );
    assert!((radius("out") - first - 0.5).abs() < 0.15, "{first} {}", radius("out"));
    for (image, word) in [("far.mhd", "E-RADIUS-ELSEWHERE"), ("mask.mhd", "E-RADIUS-NO-SCAN")] {
        let (code, text) = with(image);
        assert!(code == Some(3) && text.contains(word) && text.contains(image), "{text}");
    }
    let (code, text) = with("nowhere.mhd");
    assert!(code == Some(74) && text.contains("nowhere.mhd"), "{text}");
    let (code, text) =
        run(&["run", "mask.mhd", "-o", "out", "--set", "radius.image=ct.mhd", "--set", "radius.wall=mask"]);
    assert!(code == Some(2) && text.contains("radius.image"), "{text}");

    // A scan as input is its own, unless the mask is asked for; the same as a stage of the run's folder.
    let grown = ["--set", "volume.method=threshold", "--set", "volume.upper=-900"];
    let (code, text) = run(&[&["run", "ct.mhd", "-o", "own"], &grown[..]].concat());
    assert!(code == Some(0) && text.contains("to the wall"), "{text}");
    assert!((radius("own") - 6.0).abs() < 0.25, "{}", radius("own"));
    let whole = file("own/tree.swc");
    for stage in ["radius", "tree"] {
        let said = espalier(folder.path(), &[stage, "own", "--force"]);
        assert_eq!(said.status.code(), Some(0), "{}", stderr(&said));
    }
    assert_eq!(file("own/tree.swc"), whole);
    let (code, text) =
        run(&[&["run", "ct.mhd", "-o", "own", "--set", "radius.wall=mask"], &grown[..]].concat());
    assert!(code == Some(0) && radius("own") < 5.6, "{text} {}", radius("own"));
}
