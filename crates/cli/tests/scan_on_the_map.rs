//! The scan on the map of a run that began with a mask, and of one that has none.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::fmt::Write as _;
use std::fs;

use program::{espalier, stderr};
use tempfile::TempDir;

const SHAPE: [usize; 3] = [24, 10, 30];

/// A header of 1 mm voxels with the name of its data.
fn header(element: &str, data: &str, offset: &str) -> String {
    let mut text = String::from("ObjectType = Image\nNDims = 3\n");
    let _ = writeln!(
        text,
        "DimSize = {} {} {}\nElementSpacing = 1 1 1\nOffset = {offset}",
        SHAPE[0], SHAPE[1], SHAPE[2]
    );
    let _ = writeln!(text, "ElementType = {element}\nElementDataFile = {data}");
    text
}

/// A folder with the mask of a Y and the scan that it could be of: `mask.mhd`, `ct.mhd`, `far.mhd`, `other.mhd`.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    let is_inside = |x: usize, y: usize, z: usize| {
        let arm = if z < 15 { z.abs_diff(15) / 2 } else { 0 };
        let at_x = |center: usize| x.abs_diff(center) <= 1;
        y.abs_diff(5) <= 1 && (2..28).contains(&z) && (at_x(12 - arm) || at_x(12 + arm))
    };
    let (mut mask, mut ct, mut other) = (Vec::new(), Vec::new(), Vec::new());
    for z in 0..SHAPE[2] {
        for y in 0..SHAPE[1] {
            for x in 0..SHAPE[0] {
                mask.push(u8::from(is_inside(x, y, z)));
                let value = if is_inside(x, y, z) { -950_i16 } else { -800 + 10 * x as i16 };
                ct.extend(value.to_le_bytes());
                other.extend((value + 7).to_le_bytes());
            }
        }
    }
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).expect("write");
    write("mask.raw", &mask);
    write("ct.raw", &ct);
    write("other.raw", &other);
    write("mask.mhd", header("MET_UCHAR", "mask.raw", "0 0 0").as_bytes());
    write("ct.mhd", header("MET_SHORT", "ct.raw", "0 0 0").as_bytes());
    write("other.mhd", header("MET_SHORT", "other.raw", "0 0 0").as_bytes());
    write("far.mhd", header("MET_SHORT", "ct.raw", "500 0 0").as_bytes());
    folder
}

#[test]
fn a_mask_is_given_its_scan_and_the_record_says_which() {
    let folder = folder();
    let said = |arguments: &[&str]| {
        let output = espalier(folder.path(), arguments);
        (output.status.code(), stderr(&output))
    };
    let file = |name: &str| fs::read(folder.path().join(name)).expect("a file");
    let volume = ["--set", "render.style=volume"];
    let quick = ["--set", "render.width_px=300", "--set", "embed.pso.iterations=2"];

    // Without a scan nothing is begun, and the way out is named.
    let run = ["run", "mask.mhd", "-o", "out"];
    let (code, text) = said(&[&run[..], &volume].concat());
    assert!(code == Some(2) && text.contains("a mask") && text.contains("--image"), "{text}");
    assert!(!folder.path().join("out").exists());
    let (code, text) = said(&[&run[..], &volume, &["--image", "nowhere.mhd"]].concat());
    assert!(code == Some(74) && text.contains("nowhere.mhd"), "{text}");
    assert!(!folder.path().join("out").exists());

    let (code, text) = said(&[&run[..], &quick].concat());
    assert_eq!(code, Some(0), "{text}");
    let surface = file("out/planar.png");

    // Afterwards, of the run folder: each scan has its picture and its row, header and data.
    let render = ["render", "out"];
    let drawn = |image: &str| {
        let (code, text) = said(&[&render[..], &volume, &["--image", image]].concat());
        assert_eq!(code, Some(0), "{text}");
        let inputs = String::from_utf8(file("out/provenance/inputs.tsv")).expect("text");
        let rows: Vec<String> =
            inputs.lines().filter(|row| row.starts_with("image\t")).map(str::to_owned).collect();
        assert_eq!(rows.len(), 2, "{inputs}");
        (file("out/planar.png"), file("out/planar.exr"), rows)
    };
    let (first, second) = (drawn("ct.mhd"), drawn("other.mhd"));
    assert!(first.0 != surface && first.1 != second.1 && first.2 != second.2);
    assert!(drawn("ct.mhd") == first, "the same scan gives the same picture");
    let resolved = String::from_utf8(file("out/provenance/config.resolved.toml")).expect("text");
    assert!(resolved.contains("image = \"image.mhd\"") && !resolved.contains("ct.mhd"), "{resolved}");

    // What is no scan of it is refused, with its name.
    for (image, word) in [("far.mhd", "box"), ("mask.mhd", "a mask")] {
        let (code, text) = said(&[&render[..], &volume, &["--image", image]].concat());
        assert!(code == Some(3) && text.contains(image) && text.contains(word), "{image}: {text}");
    }
    let (code, text) =
        said(&[&render[..], &volume, &["--image", "other.mhd", "--max-memory", "4K"]].concat());
    assert!(code == Some(5), "{text}");

    for (set, word) in [
        ("render.volume.window=bone", "soft-tissue"),
        ("render.volume.window=[100, 0]", "window"),
        ("render.volume.slab=max", "minip"),
        ("render.volume.reach_mm=-1", "reach_mm"),
    ] {
        let (code, text) = said(&[&render[..], &volume, &["--image", "ct.mhd", "--set", set]].concat());
        assert!(code == Some(2) && text.contains(word), "{set}: {text}");
    }
}
