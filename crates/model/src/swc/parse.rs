//! Reads SWC text.
//!
//! **Input** bytes, and the scale from the file's units to mm. **Output** [`Traced`], nodes in file order.
//! **Notation** N nodes.
//! **Steps** 1. split the text into lines and each line into fields; 2. read and scale the numbers; 3. find each
//! parent's index by its id; 4. walk up from each node to see that no node is its own ancestor.
//! **Guarantees** those of [`Traced`]. Never panics; memory is proportional to the text; ids may be any number.
//! **Cost** O(N log N) time, O(N) memory; no recursion, so a chain may be as deep as the file is long.
//!
//! **Taken as it is meant** a byte order mark; line ends LF, CRLF or CR; blanks, tabs, or commas between fields;
//! blank lines, indents, comments after a node, comments in any encoding; columns after the seventh; ids and
//! types written as `3.0`; parents after their children; several roots; a single node; any type number.
//!
//! **Taken with a warning** a negative radius, which tracing programs write for "not measured": it becomes 0.
//!
//! **Refused** whatever could be read in two ways: NUL bytes, fewer than seven columns, commas and blanks mixed
//! between the fields (decimal commas), duplicate ids even of equal lines, negative ids, parents that are
//! missing or below −1, cycles, a node that names itself as parent, numbers that are not finite or that exceed
//! [`MAX_MM`] after scaling.

use glam::DVec3;

use super::{SwcError, SwcScale, Traced, TracedNode};
use crate::{MAX_MM, Report};

const N_COLUMNS: usize = 7;
/// What a node takes while a file is read, at most: the node and its parent's id in lists that grow by doubling, its
/// place by id, its mark.
const BYTES_OF_NODE: u64 = 256;
const COLUMN_NAMES: [&str; N_COLUMNS] = ["id", "type", "x", "y", "z", "radius", "parent"];
/// Whole numbers written as floats are exact up to here.
const MAX_EXACT: f64 = 9_007_199_254_740_992.0;
/// How much of a faulty line an error shows.
const N_SHOWN: usize = 60;

/// The memory that reading a text takes at most, in bytes, its own included.
#[must_use]
pub fn memory_bytes(text: &[u8]) -> u64 {
    let n_ends = text.iter().filter(|&&byte| byte == b'\n' || byte == b'\r').count();
    text.len() as u64 + (n_ends as u64 + 1) * BYTES_OF_NODE
}

/// Reads the bytes of an SWC file. The rules stand in the header of this file.
///
/// The report counts `nodes`, `roots`, `radius_missing` (radius 0 or negative) and `extra_column_lines`.
///
/// ```
/// use espalier_model::swc::{SwcScale, parse};
/// let (traced, _) = parse(b"1 1 0 0 0 5 -1\n2 3 0 0 10 1 1 # tip\n", &SwcScale::micrometres()).unwrap();
/// assert_eq!(traced.nodes[1].parent, Some(0));
/// assert_eq!(traced.nodes[1].position_mm.z, 0.01);
/// assert!(parse(b"1 1 0 0 0 5 1\n", &SwcScale::micrometres()).is_err()); // its own parent
/// ```
///
/// # Errors
/// [`SwcError`] with the line, for everything that the header of this file lists as refused.
pub fn parse(text: &[u8], scale: &SwcScale) -> Result<(Traced, Report), SwcError> {
    check_scale(scale)?;
    let text = text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text);
    refuse_nul(text)?;

    let mut nodes = Vec::new();
    let mut parent_ids = Vec::new();
    let mut seen = Seen::default();
    for (line_idx, line) in lines(text).enumerate() {
        seen.n_lines = line_idx + 1;
        if let Some(fields) = split_fields(line, line_idx + 1)? {
            let (node, parent_id) = read_node(&fields, scale, &mut seen)?;
            nodes.push(node);
            parent_ids.push(parent_id);
        }
    }
    if nodes.is_empty() {
        return Err(SwcError::Empty { n_lines: seen.n_lines });
    }
    resolve_parents(&mut nodes, &parent_ids)?;
    refuse_cycles(&nodes)?;
    let report = seen.into_report(&nodes);
    Ok((Traced { nodes }, report))
}

/// What is worth telling about a file that could be read.
#[derive(Default)]
struct Seen {
    n_lines: usize,
    n_extra: usize,
    n_negative_radius: usize,
    first_negative_radius: usize,
}

impl Seen {
    fn into_report(self, nodes: &[TracedNode]) -> Report {
        let mut report = Report::default();
        report.count_usize("nodes", nodes.len());
        report.count_usize("roots", nodes.iter().filter(|node| node.parent.is_none()).count());
        report.count_usize("radius_missing", nodes.iter().filter(|node| node.radius_mm == 0.0).count());
        report.count_usize("extra_column_lines", self.n_extra);
        if self.n_negative_radius > 0 {
            report.warn(
                "W-SWC-NEGATIVE-RADIUS",
                format!(
                    "{} nodes have a negative radius, the first in line {}: taken as not measured",
                    self.n_negative_radius, self.first_negative_radius
                ),
            );
        }
        report
    }
}

/// The fields of one line.
struct Fields<'a> {
    line: usize,
    columns: [&'a [u8]; N_COLUMNS],
    has_extra: bool,
}

fn check_scale(scale: &SwcScale) -> Result<(), SwcError> {
    let SwcScale { position_mm, radius_mm } = *scale;
    let is_usable = position_mm.is_finite()
        && position_mm.abs().min_element() > 0.0
        && radius_mm.is_finite()
        && radius_mm > 0.0;
    if is_usable { Ok(()) } else { Err(SwcError::Scale { position_mm, radius_mm }) }
}

fn refuse_nul(text: &[u8]) -> Result<(), SwcError> {
    match text.iter().position(|&byte| byte == 0) {
        None => Ok(()),
        Some(offset) => Err(SwcError::Binary { line: lines(&text[..=offset]).count(), offset }),
    }
}

/// The lines of a text with LF, CRLF or CR line ends.
fn lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = Some(text);
    std::iter::from_fn(move || {
        let current = rest?;
        let Some(end) = current.iter().position(|&byte| byte == b'\n' || byte == b'\r') else {
            rest = None;
            return (!current.is_empty()).then_some(current);
        };
        let n_end_bytes = if current[end..].starts_with(b"\r\n") { 2 } else { 1 };
        rest = Some(&current[end + n_end_bytes..]);
        Some(&current[..end])
    })
}

fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | 0x0B | 0x0C)
}

/// The first seven fields of a line; `None` for a blank line or a comment.
fn split_fields(line: &[u8], line_number: usize) -> Result<Option<Fields<'_>>, SwcError> {
    let code = line.split(|&byte| byte == b'#').next().unwrap_or(line).trim_ascii();
    if code.is_empty() {
        return Ok(None);
    }
    let mut columns: [&[u8]; N_COLUMNS] = [&[]; N_COLUMNS];
    let (mut has_comma, mut has_blank) = (false, false);
    let mut rest = code;
    for (column_idx, column) in columns.iter_mut().enumerate() {
        if rest.is_empty() {
            return Err(SwcError::Columns { line: line_number, n_columns: column_idx, text: shown(code) });
        }
        let end = rest.iter().position(|&b| is_blank(b) || b == b',').unwrap_or(rest.len());
        *column = &rest[..end];
        let after = rest[end..].trim_ascii_start();
        let without_comma = after.strip_prefix(b",");
        has_comma |= without_comma.is_some();
        has_blank |= without_comma.is_none() && !after.is_empty() && column_idx + 1 < N_COLUMNS;
        rest = without_comma.map_or(after, <[u8]>::trim_ascii_start);
    }
    // `3 0,5 1` would silently become the radius 0 and the parent 5.
    if has_comma && has_blank {
        return Err(SwcError::DecimalComma { line: line_number, text: shown(code) });
    }
    Ok(Some(Fields { line: line_number, columns, has_extra: !rest.is_empty() }))
}

/// The beginning of a line or field, safe to print.
fn shown(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4 * N_SHOWN)]);
    text.chars().take(N_SHOWN).map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect()
}

/// The node of a line, without its parent, and the parent's id (`None` for a root).
fn read_node(
    fields: &Fields<'_>,
    scale: &SwcScale,
    seen: &mut Seen,
) -> Result<(TracedNode, Option<i64>), SwcError> {
    let line = fields.line;
    let id = fields.whole(0, 0..=i64::MAX, "a whole number of at least 0 and below 2^63")?;
    let kind = fields.whole(1, i64::from(i32::MIN)..=i64::from(i32::MAX), "a whole number of 32 bits")?;
    let position_mm = DVec3::new(
        fields.length_mm(2, scale.position_mm.x)?,
        fields.length_mm(3, scale.position_mm.y)?,
        fields.length_mm(4, scale.position_mm.z)?,
    );
    let stated_radius_mm = fields.length_mm(5, scale.radius_mm)?;
    let parent = fields.whole(6, -1..=i64::MAX, "the id of a node, or -1 for a root")?;

    seen.n_extra += usize::from(fields.has_extra);
    if stated_radius_mm < 0.0 {
        seen.n_negative_radius += 1;
        if seen.n_negative_radius == 1 {
            seen.first_negative_radius = line;
        }
    }
    let radius_mm = if stated_radius_mm > 0.0 { stated_radius_mm } else { 0.0 };
    let node = TracedNode { id, kind: kind as i32, position_mm, radius_mm, parent: None, line };
    Ok((node, (parent >= 0).then_some(parent)))
}

impl Fields<'_> {
    fn error(&self, column_idx: usize, expected: &'static str) -> SwcError {
        let (line, column) = (self.line, COLUMN_NAMES[column_idx]);
        SwcError::Number { line, column, text: shown(self.columns[column_idx]), expected }
    }

    /// A whole number, perhaps written as `3.0`.
    fn whole(
        &self,
        column_idx: usize,
        legal: std::ops::RangeInclusive<i64>,
        expected: &'static str,
    ) -> Result<i64, SwcError> {
        let text = std::str::from_utf8(self.columns[column_idx]).unwrap_or("");
        let as_float = || {
            let value = text.parse::<f64>().ok()?;
            (value.trunc() == value && value.abs() <= MAX_EXACT).then_some(value as i64)
        };
        text.parse::<i64>()
            .ok()
            .or_else(as_float)
            .filter(|value| legal.contains(value))
            .ok_or_else(|| self.error(column_idx, expected))
    }

    /// A finite number times `unit_mm`.
    fn length_mm(&self, column_idx: usize, unit_mm: f64) -> Result<f64, SwcError> {
        let text = std::str::from_utf8(self.columns[column_idx]).unwrap_or("");
        let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
        let value_mm = value.ok_or_else(|| self.error(column_idx, "a finite number"))? * unit_mm;
        if value_mm.abs() <= MAX_MM {
            // Adding zero turns a negative zero into a plain one.
            Ok(value_mm + 0.0)
        } else {
            Err(SwcError::Range { line: self.line, column: COLUMN_NAMES[column_idx], value_mm })
        }
    }
}

/// Gives each node the index of the node that has its parent's id.
fn resolve_parents(nodes: &mut [TracedNode], parent_ids: &[Option<i64>]) -> Result<(), SwcError> {
    let mut by_id: Vec<(i64, usize)> = nodes.iter().enumerate().map(|(idx, node)| (node.id, idx)).collect();
    by_id.sort_unstable();
    let repeated = by_id.windows(2).filter(|pair| pair[0].0 == pair[1].0).min_by_key(|pair| pair[1].1);
    if let Some(&[(id, first), (_, second)]) = repeated {
        let (line, first_line) = (nodes[second].line, nodes[first].line);
        return Err(SwcError::DuplicateId { line, id, first_line });
    }
    for (node, &parent_id) in nodes.iter_mut().zip(parent_ids) {
        let Some(parent) = parent_id else { continue };
        let found = by_id.binary_search_by_key(&parent, |&(id, _)| id);
        let found = found.map_err(|_| SwcError::MissingParent { line: node.line, id: node.id, parent })?;
        node.parent = Some(by_id[found].1);
    }
    Ok(())
}

/// Walks up from each node until a root or a node seen before; meeting the own path is a cycle.
fn refuse_cycles(nodes: &[TracedNode]) -> Result<(), SwcError> {
    const UNSEEN: usize = usize::MAX;
    let mut walk_of = vec![UNSEEN; nodes.len()];
    for start in 0..nodes.len() {
        let mut current = start;
        while walk_of[current] == UNSEEN {
            walk_of[current] = start;
            let Some(parent) = nodes[current].parent else { break };
            if walk_of[parent] == start {
                return Err(cycle_error(nodes, current, parent));
            }
            current = parent;
        }
    }
    Ok(())
}

fn cycle_error(nodes: &[TracedNode], node: usize, parent: usize) -> SwcError {
    let mut n_nodes = 1;
    let mut current = parent;
    while current != node {
        n_nodes += 1;
        current = nodes[current].parent.unwrap_or(node);
    }
    SwcError::Cycle {
        line: nodes[node].line,
        id: nodes[node].id,
        parent: nodes[parent].id,
        parent_line: nodes[parent].line,
        n_nodes,
    }
}
