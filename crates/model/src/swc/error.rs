//! Why an SWC file cannot be used.

use thiserror::Error;

use crate::diagnose::{Class, Diagnose};
use crate::{MAX_MM, TreeError};

/// Why an SWC file cannot be used. Lines count from 1.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SwcError {
    /// Nothing but comments and blank lines.
    #[error("the file holds no node ({n_lines} lines, all blank or comments)")]
    Empty {
        /// How many lines there are.
        n_lines: usize,
    },
    /// A NUL byte: no text file, or one whose end was never written.
    #[error("line {line} holds a NUL byte (byte {offset} of the file), so this is not an SWC text")]
    Binary {
        /// The line.
        line: usize,
        /// The byte, from 0.
        offset: usize,
    },
    /// Fewer than seven columns.
    #[error("line {line} has {n_columns} columns, expected 7 (id type x y z radius parent): `{text}`")]
    Columns {
        /// The line.
        line: usize,
        /// How many columns it has.
        n_columns: usize,
        /// How the line begins.
        text: String,
    },
    /// Commas and blanks both separate fields.
    #[error("line {line} mixes commas and blanks between its fields, as decimal commas do: `{text}`")]
    DecimalComma {
        /// The line.
        line: usize,
        /// How the line begins.
        text: String,
    },
    /// A field that is not the number it should be.
    #[error("line {line}: {column} is `{text}`, expected {expected}")]
    Number {
        /// The line.
        line: usize,
        /// The column's name.
        column: &'static str,
        /// What stands there.
        text: String,
        /// What should stand there.
        expected: &'static str,
    },
    /// A position or radius beyond any organ.
    #[error("line {line}: {column} is {value_mm:e} mm, allowed are at most {MAX_MM:e} mm")]
    Range {
        /// The line.
        line: usize,
        /// The column's name.
        column: &'static str,
        /// The number after scaling.
        value_mm: f64,
    },
    /// Two nodes with one id.
    #[error("line {line}: id {id} stands already in line {first_line}")]
    DuplicateId {
        /// The line.
        line: usize,
        /// The id.
        id: i64,
        /// The line of the first node with this id.
        first_line: usize,
    },
    /// A parent that no line has.
    #[error("line {line}: node {id} names parent {parent}, which no line of the file has")]
    MissingParent {
        /// The line.
        line: usize,
        /// The node.
        id: i64,
        /// The parent it names.
        parent: i64,
    },
    /// A node among its own ancestors.
    #[error(
        "line {line}: node {id} names {}",
        if *n_nodes == 1 {
            "itself as its parent".to_owned()
        } else {
            format!("parent {parent} (line {parent_line}), which descends from node {id}: a cycle of {n_nodes} nodes")
        }
    )]
    Cycle {
        /// The line of the node.
        line: usize,
        /// The node.
        id: i64,
        /// Its parent.
        parent: i64,
        /// The line of its parent.
        parent_line: usize,
        /// How many nodes the cycle has.
        n_nodes: usize,
    },
    /// A scale that is zero or not finite.
    #[error("the scale {position_mm} mm, radius {radius_mm} mm is not usable")]
    Scale {
        /// Mm for one unit of x, y, z.
        position_mm: glam::DVec3,
        /// Mm for one unit of radius.
        radius_mm: f64,
    },
    /// A file that should be ours has another header.
    #[error("the header says {key} `{found:.60}`, expected `{expected}`")]
    Header {
        /// The header key.
        key: &'static str,
        /// What stands there; empty if the key is missing.
        found: String,
        /// What should stand there.
        expected: &'static str,
    },
    /// The nodes are well formed but are not one rooted tree.
    #[error(transparent)]
    Tree(#[from] TreeError),
}

impl Diagnose for SwcError {
    fn code(&self) -> &'static str {
        match self {
            Self::Empty { .. } => "E-SWC-EMPTY",
            Self::Binary { .. } => "E-SWC-BINARY",
            Self::Columns { .. } => "E-SWC-COLUMNS",
            Self::DecimalComma { .. } => "E-SWC-COMMA",
            Self::Number { .. } => "E-SWC-NUMBER",
            Self::Range { .. } => "E-SWC-RANGE",
            Self::DuplicateId { .. } => "E-SWC-DUPLICATE",
            Self::MissingParent { .. } => "E-SWC-PARENT",
            Self::Cycle { .. } => "E-SWC-CYCLE",
            Self::Scale { .. } => "E-SWC-SCALE",
            Self::Header { .. } => "E-SWC-HEADER",
            Self::Tree(error) => error.code(),
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::Scale { .. } => Class::Usage,
            Self::Tree(error) => error.class(),
            _ => Class::Input,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::Empty { .. } => "check that the export was completed",
            Self::Binary { .. } => {
                "if the text is right up to this line, the rest was never written: export the file again; \
                 UTF-16 text must be converted to UTF-8"
            }
            Self::Columns { .. } => {
                "a header line must begin with `#`; a short last line means a file cut off"
            }
            Self::DecimalComma { .. } => {
                "write numbers with a decimal point, or separate every field by a comma"
            }
            Self::Number { .. } => "correct the line, or put `#` before it to leave it out",
            Self::Range { .. } => "check the number, and the unit the file is read in",
            Self::DuplicateId { .. } => "remove one of the two lines, or give it an id of its own",
            Self::MissingParent { parent: 0, .. } => "if 0 marks roots in this file, write -1 instead",
            Self::MissingParent { .. } => "add the line of the parent, or write -1 to make the node a root",
            Self::Cycle { .. } => "write -1 as the parent of the node that should be the root",
            Self::Scale { .. } => "give finite factors that are not zero, the radius factor above zero",
            Self::Header { .. } => "give the file as a traced neuron instead, with its unit",
            Self::Tree(error) => return error.hint(),
        }
        .to_owned()
    }

    fn line(&self) -> Option<usize> {
        match self {
            Self::Binary { line, .. }
            | Self::Columns { line, .. }
            | Self::DecimalComma { line, .. }
            | Self::Number { line, .. }
            | Self::Range { line, .. }
            | Self::DuplicateId { line, .. }
            | Self::MissingParent { line, .. }
            | Self::Cycle { line, .. } => Some(*line),
            Self::Empty { .. } | Self::Scale { .. } | Self::Header { .. } | Self::Tree(_) => None,
        }
    }
}
