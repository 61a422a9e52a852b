//! SWC: the rules of the reader case by case, and every neuron of the real data.
#![allow(clippy::expect_used, clippy::panic, clippy::print_stdout, reason = "this is how a test speaks")]
#![allow(clippy::disallowed_methods, reason = "tests find their data through the environment")]

use std::path::{Path, PathBuf};

use espalier_geom::random::{Purpose, Stream};
use espalier_model::Diagnose;
use espalier_model::swc::{SwcError, SwcScale, Traced, parse};
use glam::DVec3;

/// `nodes/roots`, or the error's code.
fn outcome(text: &[u8]) -> String {
    match parse(text, &SwcScale::micrometres()) {
        Ok((traced, report)) => {
            let n_roots = traced.nodes.iter().filter(|node| node.parent.is_none()).count();
            assert_eq!(report.get("roots"), Some(n_roots as f64));
            format!("{}/{n_roots}", traced.nodes.len())
        }
        Err(error) => {
            assert!(!error.hint().is_empty(), "{error} has no way out");
            error.code().to_owned()
        }
    }
}

#[test]
fn rules() {
    let cases: &[(&str, &str, &str)] = &[
        ("plain", "1 1 0 0 0 1 -1\n2 3 0 0 1 1 1\n", "2/1"),
        ("byte order mark", "\u{FEFF}1 1 0 0 0 1 -1", "1/1"),
        ("CRLF, CR, blank lines", "1 1 0 0 0 1 -1\r\n\r\n2 3 0 0 1 1 1\r3 3 0 0 1 1 2\r\r", "3/1"),
        ("tabs and indents", "\t 1\t1\t0 0\t\t0 1 -1  \n", "1/1"),
        ("commas", "1,1,0,0,0,1,-1\n2, 3, 0 ,0 , 1,1,1,\n", "2/1"),
        ("extra columns", "1 1 0 0 0 1 -1 a,b 7\n", "1/1"),
        ("comment after a node", "1 1 0 0 0 1 -1#tip, 2 3\n", "1/1"),
        ("float ids", "1.0 1.0 0 0 0 1 -1.0\n", "1/1"),
        ("float id that is no whole number", "1.5 1 0 0 0 1 -1\n", "E-SWC-NUMBER"),
        ("child before parent", "2 3 0 0 1 1 1\n1 1 0 0 0 1 -1\n", "2/1"),
        ("two roots", "1 1 0 0 0 1 -1\n2 1 1 0 0 1 -1\n", "2/2"),
        ("the largest id", "9223372036854775807 1 0 0 0 1 -1\n", "1/1"),
        ("an id beyond 64 bits", "9223372036854775808 1 0 0 0 1 -1\n", "E-SWC-NUMBER"),
        ("negative id", "-2 1 0 0 0 1 -1\n", "E-SWC-NUMBER"),
        ("id 0", "0 1 0 0 0 1 -1\n1 1 0 0 1 1 0\n", "2/1"),
        ("parent 0 without a node 0", "1 1 0 0 0 1 0\n", "E-SWC-PARENT"),
        ("parent below -1", "1 1 0 0 0 1 -2\n", "E-SWC-NUMBER"),
        ("negative type", "1 -5 0 0 0 1 -1\n", "1/1"),
        ("type beyond 32 bits", "1 2147483648 0 0 0 1 -1\n", "E-SWC-NUMBER"),
        ("negative radius", "1 1 0 0 0 -1 -1\n", "1/1"),
        ("infinite radius", "1 1 0 0 0 inf -1\n", "E-SWC-NUMBER"),
        ("NaN position", "1 1 NaN 0 0 1 -1\n", "E-SWC-NUMBER"),
        ("far beyond any organ", "1 1 9e13 0 0 1 -1\n", "1/1"),
        ("beyond what is allowed", "1 1 1.1e14 0 0 1 -1\n", "E-SWC-RANGE"),
        ("overflow to infinity", "1 1 1e999 0 0 1 -1\n", "E-SWC-NUMBER"),
        ("six columns", "1 1 0 0 0 1\n", "E-SWC-COLUMNS"),
        ("a header without #", "id type x y z radius parent\n", "E-SWC-NUMBER"),
        ("decimal comma", "1 1 0 0 0 0,5 -1\n", "E-SWC-COMMA"),
        ("decimal comma after the last field", "1 1 0 0 0 1 -1,0\n", "E-SWC-COMMA"),
        ("empty field", "1,1,0,,0,1,-1\n", "E-SWC-NUMBER"),
        ("semicolons", "1;1;0;0;0;1;-1\n", "E-SWC-COLUMNS"),
        ("self loop", "1 1 0 0 0 1 1\n", "E-SWC-CYCLE"),
        ("cycle beside a tree", "1 1 0 0 0 1 -1\n2 1 0 0 0 1 3\n3 1 0 0 0 1 2\n", "E-SWC-CYCLE"),
        ("equal lines", "1 1 0 0 0 1 -1\n1 1 0 0 0 1 -1\n", "E-SWC-DUPLICATE"),
        ("NUL at the end", "1 1 0 0 0 1 -1\n\0\0", "E-SWC-BINARY"),
        ("nothing", "", "E-SWC-EMPTY"),
        ("only a comment", "# 1 1 0 0 0 1 -1", "E-SWC-EMPTY"),
    ];
    for (name, text, expected) in cases {
        assert_eq!(outcome(text.as_bytes()), *expected, "{name}");
    }
    assert_eq!(outcome(b"# \xB5m\n1 1 0 0 0 1 -1 # \xFF\n"), "1/1", "comments in Latin-1");
    assert_eq!(outcome(b"1 1 \xB5 0 0 1 -1\n"), "E-SWC-NUMBER", "a field that is no text");
}

#[test]
fn errors_name_both_lines() {
    let error = |text: &str| parse(text.as_bytes(), &SwcScale::micrometres()).expect_err("refused");
    assert_eq!(
        error("# head\n7 1 0 0 0 1 -1\n\n8 1 0 0 1 1 7\n7 1 0 0 2 1 8\n"),
        SwcError::DuplicateId { line: 5, id: 7, first_line: 2 }
    );
    assert_eq!(
        error("1 1 0 0 0 1 -1\r\n5 1 0 0 0 1 6\r\n6 1 0 0 0 1 7\r\n7 1 0 0 0 1 5\r\n"),
        SwcError::Cycle { line: 4, id: 7, parent: 5, parent_line: 2, n_nodes: 3 }
    );
    assert_eq!(error("1 1 0 0 0 1 -1\n2 1 0 0 0 1 9"), SwcError::MissingParent { line: 2, id: 2, parent: 9 });
    assert_eq!(error("1 1 0 0 0 1 -1\n\0"), SwcError::Binary { line: 2, offset: 15 });
}

#[test]
fn scale_and_warnings() {
    let scale = SwcScale { position_mm: DVec3::new(-0.5, -0.5, 2.0), radius_mm: 0.1 };
    let (traced, report) = parse(b"4 2 1 2 3 10 -1\n6 2 1 2 4 -1 4 x\n", &scale).expect("legal");
    assert_eq!(traced.nodes[0].position_mm, DVec3::new(-0.5, -1.0, 6.0));
    assert_eq!((traced.nodes[0].radius_mm, traced.nodes[1].radius_mm), (1.0, 0.0));
    assert_eq!((traced.nodes[0].kind, traced.nodes[1].line), (2, 2));
    assert_eq!(report.get("extra_column_lines"), Some(1.0));
    assert_eq!(report.warnings.len(), 1);
    assert!(report.warnings[0].message.contains("line 2"), "{:?}", report.warnings);
    for unit_mm in [0.0, f64::NAN, f64::INFINITY] {
        let error = parse(b"1 1 0 0 0 1 -1", &SwcScale::uniform(unit_mm)).expect_err("no scale");
        assert_eq!(error.code(), "E-SWC-SCALE");
    }
}

/// A chain of 300,000 nodes, leaf first, and a cycle as long: neither may need the stack.
#[test]
fn depth_is_the_files_not_ours() {
    let n_nodes = 300_000_usize;
    let line = |id: usize, parent: String| format!("{id} 3 0 0 {id} 1 {parent}\n");
    let mut text: String = (2..=n_nodes).rev().map(|id| line(id, (id - 1).to_string())).collect();
    assert_eq!(outcome((text.clone() + &line(1, "-1".to_owned())).as_bytes()), format!("{n_nodes}/1"));
    text += &line(1, n_nodes.to_string());
    let error = parse(text.as_bytes(), &SwcScale::micrometres()).expect_err("a cycle");
    assert!(matches!(error, SwcError::Cycle { n_nodes: 300_000, .. }), "{error}");
}

/// 2000 mutants of a small file: none may panic, and what is accepted must keep the guarantees.
#[test]
fn mutants_never_panic() {
    let original =
        b"\xEF\xBB\xBF# head\r\n1 1 0 0 0 5 -1\n2,3,0,1.5,1e-3,1,1\n\t3 3 0 -2 2.5 .5 2 # x\n4 3 1 2 3 0 2";
    let mut stream = Stream::new(23, Purpose::Test, 0, 0);
    let mut n_read = 0;
    for _ in 0..2000 {
        let mut bytes = original.to_vec();
        for _ in 0..1 + stream.below(3) {
            let at = stream.below(bytes.len() as u32) as usize;
            let pool = b"0123456789-+.,e#\n\r\t \0\xFFinfa";
            bytes[at] = pool[stream.below(pool.len() as u32) as usize];
        }
        let Ok((Traced { nodes }, _)) = parse(&bytes, &SwcScale::nanometres()) else { continue };
        n_read += 1;
        for (node_idx, node) in nodes.iter().enumerate() {
            assert!(node.position_mm.is_finite() && node.radius_mm >= 0.0 && node.radius_mm.is_finite());
            // The way up ends within as many steps as there are nodes.
            let above = |idx: &usize| nodes[*idx].parent;
            assert!(
                std::iter::successors(Some(node_idx), above).take(nodes.len() + 1).count() <= nodes.len()
            );
        }
    }
    assert!((200..1800).contains(&n_read), "{n_read} of 2000 read: too one-sided to test much");
}

fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("ESPALIER_DATA").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: ESPALIER_DATA not set");
    }
    folder
}

/// Every `.swc` under a folder, sorted.
fn swc_files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a readable folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "swc") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

#[test]
fn real_neurons_are_well_formed() {
    let Some(data) = data() else { return };
    let files = swc_files(&data.join("neurons"));
    assert!(files.len() > 50, "only {} neurons", files.len());
    for path in files {
        let text = std::fs::read(&path).expect("readable");
        let (Traced { nodes }, report) = parse(&text, &SwcScale::micrometres())
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let is_node = |line: &&[u8]| line.trim_ascii_start().first().is_some_and(u8::is_ascii_digit);
        let n_lines = text.split(|&byte| byte == b'\n').filter(is_node).count();
        assert_eq!(nodes.len(), n_lines, "{}", path.display());
        if path.ends_with("hemibrain_754538881.swc") {
            assert_eq!(report.get("roots"), Some(2.0));
        }
    }
}
