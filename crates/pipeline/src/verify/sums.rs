//! The list of a folder's results: what it names is what it was, and what has been made is in it.

use std::collections::BTreeSet;
use std::path::{Component, Path};

use espalier_verify::Check;

use super::{CONFIG, DICTIONARY, Folder, Has, Malformed, SUMS, read_of};
use crate::error::Error;
use crate::folder::{file_digest, hex_digest, is_absent};
use crate::record::Record;
use crate::stage::Stage;

/// What became of `SHA256SUMS`.
pub(super) struct Sums {
    /// A check for each file in it, and for each that ought to be.
    pub(super) checks: Vec<(String, Check)>,
    /// What there is.
    pub(super) has: Has,
    /// Its own digest.
    pub(super) digest: String,
}

impl Folder<'_> {
    /// Checks every file of `SHA256SUMS`, and what ought to be in it.
    pub(super) fn sums(&self) -> Result<Sums, Error> {
        let malformed = |cause| Error::file(&self.0.join(SUMS), cause);
        let bytes = self.bytes(SUMS)?;
        let text = std::str::from_utf8(&bytes).map_err(|error| malformed(error.into()))?;
        let mut checks = Vec::new();
        for (idx, line) in text.lines().enumerate() {
            let wrong = || Malformed::Line { line: idx + 1, text: line.chars().take(80).collect() };
            let (digest, file) = digest_line(line).ok_or_else(|| malformed(wrong()))?;
            let path = self.0.join(file);
            let found = match file_digest(&path) {
                Ok((_, found)) => found,
                Err(source) if is_absent(&source) => "no such file".to_owned(),
                Err(source) => return Err(Error::Read { path, source }),
            };
            checks.push((file.to_owned(), Check::same("sha256", digest, found)));
        }
        if checks.is_empty() {
            return Err(malformed(Malformed::Empty));
        }
        let listed: BTreeSet<String> = checks.iter().map(|(file, _)| file.clone()).collect();
        let has = self.has(&listed);
        for file in self.expected(&has).difference(&listed) {
            let fault = Some("no line in SHA256SUMS".to_owned());
            checks.push((file.clone(), Check::unless("sealed", "yes", fault)));
        }
        Ok(Sums { checks, has, digest: hex_digest(&bytes) })
    }

    /// What the folder claims to have: by its list, or by what lies there.
    fn has(&self, listed: &BTreeSet<String>) -> Has {
        let is_there = |file: &String| listed.contains(file) || self.0.join(file).exists();
        // Two stages write the dictionary, so it speaks for neither.
        let was_done =
            |stage: &Stage| stage.writes().iter().filter(|file| *file != DICTIONARY).any(&is_there);
        let is_run = is_there(&CONFIG.to_owned()) || self.0.join("stages").is_dir();
        let stages = if is_run { Stage::ALL.into_iter().filter(was_done).collect() } else { Vec::new() };
        let tables = listed.iter().filter(|file| is_table(file)).cloned().collect();
        Has { is_run, stages, tables }
    }

    /// The files that have to be in the list.
    fn expected(&self, has: &Has) -> BTreeSet<String> {
        let read = has.stages.iter().flat_map(|stage| read_of(*stage)).map(|file| (*file).to_owned());
        let config = has.is_run.then(|| CONFIG.to_owned());
        read.chain(config).chain(self.made_by_stages()).collect()
    }

    /// What the records of the stages name, and the records.
    fn made_by_stages(&self) -> Vec<String> {
        let made = |stage: Stage| {
            let record_file = Record::file_of(stage);
            let record = Record::parsed(stage, &self.bytes(&record_file).ok()?)?;
            Some(record.files().keys().cloned().chain([record_file]).collect::<Vec<_>>())
        };
        Stage::ALL.into_iter().filter_map(made).flatten().collect()
    }
}

/// Whether a file is a table that the dictionary has to explain: not itself.
fn is_table(file: &str) -> bool {
    Path::new(file).extension().is_some_and(|extension| extension == "tsv") && file != DICTIONARY
}

/// A line of `SHA256SUMS`; no file outside of the folder is anyone's business.
fn digest_line(line: &str) -> Option<(&str, &str)> {
    let (digest, file) = line.split_once("  ")?;
    let is_digest = digest.len() == 64 && digest.bytes().all(|byte| byte.is_ascii_hexdigit());
    let is_inside = Path::new(file).components().all(|part| matches!(part, Component::Normal(_)));
    (is_digest && is_inside && !file.is_empty()).then_some((digest, file))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_sums() {
        let digest = "0123456789abcdef".repeat(4);
        assert_eq!(digest_line(&format!("{digest}  a/b c.tsv")), Some((digest.as_str(), "a/b c.tsv")));
        for file in ["/etc/passwd", "../other/tree.swc", "a/../../b", ""] {
            assert_eq!(digest_line(&format!("{digest}  {file}")), None, "{file}");
        }
        assert_eq!(digest_line("short  tree.swc"), None);
    }
}
