//! VTK's legacy format, `.vtk`.
//!
//! **Input** bytes. **Output** [`Dataset`].
//! **Steps** 1. version, title, ascii or binary; 2. keyword by keyword: points, cells of versions before and from 5, arrays
//! of points and cells; 3. at a keyword that is not known, reading ends, and the caller is told.
//! **Guarantees** a count is compared with the bytes and the memory that are left before anything is made of it; numbers of
//! binary files are big-endian.

use super::{Budget, Dataset, NUMBERS_OF_LINE, PolydataError};

pub(super) fn parse(bytes: &[u8], budget: &Budget) -> Result<Dataset, PolydataError> {
    let mut cursor = Cursor { rest: bytes, is_binary: false, budget };
    cursor.line();
    let title = String::from_utf8_lossy(cursor.line()).into_owned();
    cursor.is_binary = match cursor.word() {
        Some(word) if word.eq_ignore_ascii_case("ASCII") => false,
        Some(word) if word.eq_ignore_ascii_case("BINARY") => true,
        word => return Err(unknown("a file that is neither ASCII nor BINARY", word)),
    };
    let (keyword, kind) = (cursor.word(), cursor.word());
    if keyword.as_deref() != Some("DATASET") || kind.as_deref() != Some("POLYDATA") {
        return Err(unknown("a data set of this type", kind));
    }
    let space = ["RAS", "LPS"].into_iter().find(|space| title.contains(&format!("SPACE={space}")));
    let mut dataset = Dataset { space: space.map(str::to_owned), ..Dataset::default() };
    let mut about = About::default();
    while let Some(keyword) = cursor.word() {
        if !section(&keyword, &mut cursor, &mut dataset, &mut about)? {
            dataset.unread = Some(format!("the keyword {:?}", keyword.chars().take(40).collect::<String>()));
            break;
        }
    }
    Ok(dataset)
}

/// What the arrays that come next are about.
#[derive(Default)]
struct About {
    is_cells: bool,
    /// Values in each array.
    n_values: usize,
}

/// Reads one section; `false` for one that is not known.
fn section(
    keyword: &str,
    cursor: &mut Cursor<'_>,
    dataset: &mut Dataset,
    about: &mut About,
) -> Result<bool, PolydataError> {
    match keyword.to_ascii_uppercase().as_str() {
        "POINTS" => {
            let n_points = cursor.count()?;
            dataset.points = cursor.numbers(n_points.saturating_mul(3), None)?;
        }
        "LINES" => dataset.lines = cells(cursor)?,
        "VERTICES" => {
            let n_cells = cells(cursor)?.len();
            dataset.n_cells_before += n_cells;
            dataset.n_other_cells += n_cells;
        }
        "POLYGONS" | "TRIANGLE_STRIPS" => dataset.n_other_cells += cells(cursor)?.len(),
        "POINT_DATA" => *about = About { is_cells: false, n_values: cursor.count()? },
        "CELL_DATA" => *about = About { is_cells: true, n_values: cursor.count()? },
        "SCALARS" => {
            let (name, scalar) = (cursor.required("a name")?, cursor.required("a type")?);
            let mut n_components = 1;
            // A number of components may follow on this line, a table of colours on the next.
            if cursor.is_same_line()
                && let Some(Ok(n)) = cursor.peek().map(|word| word.parse::<usize>())
            {
                cursor.word();
                n_components = n;
            }
            if cursor.peek().is_some_and(|word| word.eq_ignore_ascii_case("LOOKUP_TABLE")) {
                cursor.word();
                cursor.word();
            }
            let numbers = cursor.numbers(about.n_values.saturating_mul(n_components), Some(scalar))?;
            keep(dataset, about, name, n_components, numbers);
        }
        "VECTORS" | "NORMALS" => {
            let (_, scalar) = (cursor.required("a name")?, cursor.required("a type")?);
            cursor.numbers(about.n_values.saturating_mul(3), Some(scalar))?;
        }
        "FIELD" => {
            cursor.required("a name")?;
            for _ in 0..cursor.count()? {
                if !field_array(cursor, dataset, about)? {
                    return Ok(false);
                }
            }
        }
        "METADATA" => cursor.skip_metadata(),
        _ => return Ok(false),
    }
    Ok(true)
}

/// One array of a field; `false` for words, whose length cannot be told.
fn field_array(cursor: &mut Cursor<'_>, dataset: &mut Dataset, about: &About) -> Result<bool, PolydataError> {
    let mut name = cursor.required("a name")?;
    while name == "METADATA" {
        cursor.skip_metadata();
        name = cursor.required("a name")?;
    }
    let (n_components, n_values) = (cursor.count()?, cursor.count()?);
    let scalar = cursor.required("a type")?;
    if scalar == "string" || scalar == "variant" {
        return Ok(false);
    }
    let numbers = cursor.numbers(n_values.saturating_mul(n_components), Some(scalar))?;
    if n_values == about.n_values {
        keep(dataset, about, name, n_components, numbers);
    }
    Ok(true)
}

/// Keeps an array of one number for each point or cell.
fn keep(dataset: &mut Dataset, about: &About, name: String, n_components: usize, numbers: Vec<f64>) {
    if n_components == 1 {
        let arrays = if about.is_cells { &mut dataset.cell_arrays } else { &mut dataset.point_arrays };
        arrays.push((name, numbers));
    }
}

/// Cells as lists of points: from version 5 as offsets and points, before as lengths and points.
fn cells(cursor: &mut Cursor<'_>) -> Result<Vec<Vec<usize>>, PolydataError> {
    let (n_first, n_second) = (cursor.count()?, cursor.count()?);
    cursor.budget.spend(n_first.saturating_mul(NUMBERS_OF_LINE))?;
    let index = |&number: &f64| if number >= 0.0 { number as usize } else { usize::MAX };
    if cursor.peek().as_deref() == Some("OFFSETS") {
        cursor.word();
        let scalar = cursor.required("a type")?;
        let offsets = cursor.numbers(n_first, Some(scalar))?;
        if cursor.required("CONNECTIVITY")? != "CONNECTIVITY" {
            return Err(PolydataError::Missing { what: "connectivity of cells" });
        }
        let scalar = cursor.required("a type")?;
        let points = cursor.numbers(n_second, Some(scalar))?;
        let cell = |pair: &[f64]| {
            points.get(pair[0] as usize..pair[1] as usize).map(|cell| cell.iter().map(index).collect())
        };
        let cells: Option<Vec<Vec<usize>>> = offsets.windows(2).map(cell).collect();
        return cells.ok_or(PolydataError::Missing { what: "point for each corner of the cells" });
    }
    let numbers = cursor.numbers(n_second, Some("int".to_owned()))?;
    let mut rest = &numbers[..];
    let mut cells = Vec::new();
    while let Some((length, after)) = rest.split_first() {
        let cell = after.split_at_checked(index(length));
        let (cell, after) =
            cell.ok_or(PolydataError::Missing { what: "point for each corner of the cells" })?;
        if cells.len() == n_first {
            return Err(PolydataError::Missing { what: "count of cells that is as large as their list" });
        }
        cells.push(cell.iter().map(index).collect());
        rest = after;
    }
    if cells.len() == n_first {
        return Ok(cells);
    }
    Err(PolydataError::Count { what: "the list of cells".to_owned(), found: cells.len(), expected: n_first })
}

fn unknown(what: &'static str, word: Option<String>) -> PolydataError {
    PolydataError::Unknown { what, found: word.unwrap_or_default().chars().take(40).collect() }
}

/// What is left of the file.
struct Cursor<'a> {
    rest: &'a [u8],
    is_binary: bool,
    budget: &'a Budget,
}

impl<'a> Cursor<'a> {
    /// The rest of the line.
    fn line(&mut self) -> &'a [u8] {
        let end = self.rest.iter().position(|&byte| byte == b'\n').map_or(self.rest.len(), |end| end + 1);
        let (line, rest) = self.rest.split_at(end);
        self.rest = rest;
        line
    }

    /// The next word and what follows it.
    fn split(&self) -> Option<(&'a [u8], &'a [u8])> {
        let start = self.rest.trim_ascii_start();
        let end = start.iter().position(u8::is_ascii_whitespace).unwrap_or(start.len());
        (end > 0).then(|| start.split_at(end))
    }

    fn word(&mut self) -> Option<String> {
        let (word, rest) = self.split()?;
        self.rest = rest;
        Some(String::from_utf8_lossy(word).into_owned())
    }

    fn peek(&self) -> Option<String> {
        self.split().map(|(word, _)| String::from_utf8_lossy(word).into_owned())
    }

    /// Whether the next word stands on this line.
    fn is_same_line(&self) -> bool {
        !self.rest.iter().take_while(|byte| byte.is_ascii_whitespace()).any(|&byte| byte == b'\n')
    }

    fn required(&mut self, what: &'static str) -> Result<String, PolydataError> {
        self.word().ok_or(PolydataError::Missing { what })
    }

    /// A number of things, each of which takes a byte at the least.
    fn count(&mut self) -> Result<usize, PolydataError> {
        let word = self.required("number")?;
        let count = word.parse::<usize>().ok().filter(|&count| count <= self.rest.len());
        count.ok_or_else(|| PolydataError::Word {
            what: "a number of things that the file can hold",
            found: word.chars().take(40).collect(),
        })
    }

    /// So many numbers of a type, or of the type that stands next.
    fn numbers(&mut self, n_numbers: usize, scalar: Option<String>) -> Result<Vec<f64>, PolydataError> {
        let scalar = match scalar {
            Some(scalar) => scalar,
            None => self.required("a type")?,
        };
        if n_numbers > self.rest.len() {
            let found = self.rest.len();
            return Err(PolydataError::Count { what: scalar, found, expected: n_numbers });
        }
        self.budget.spend(n_numbers)?;
        if !self.is_binary {
            return (0..n_numbers).map(|_| self.number()).collect();
        }
        // The numbers begin on the line after.
        self.line();
        let (n_bytes, convert) =
            binary(&scalar).ok_or_else(|| unknown("numbers of this type", Some(scalar.clone())))?;
        let bytes = self.rest.split_at_checked(n_bytes * n_numbers);
        let (bytes, rest) = bytes.ok_or_else(|| PolydataError::Count {
            what: scalar.clone(),
            found: self.rest.len() / n_bytes,
            expected: n_numbers,
        })?;
        self.rest = rest;
        Ok(bytes.chunks_exact(n_bytes).map(convert).collect())
    }

    fn number(&mut self) -> Result<f64, PolydataError> {
        let word = self.required("number")?;
        word.parse()
            .map_err(|_| PolydataError::Word { what: "a number", found: word.chars().take(40).collect() })
    }

    /// A block of information about an array, which ends with an empty line.
    fn skip_metadata(&mut self) {
        self.line();
        while !self.line().trim_ascii().is_empty() {}
    }
}

/// Makes a number of its bytes.
type Convert = fn(&[u8]) -> f64;

/// Bytes of a number of a type, and what makes it of them.
fn binary(scalar: &str) -> Option<(usize, Convert)> {
    macro_rules! as_type {
        ($number:ty) => {
            (size_of::<$number>(), |bytes: &[u8]| {
                bytes.try_into().map_or(0.0, |bytes| <$number>::from_be_bytes(bytes) as f64)
            })
        };
    }
    Some(match scalar.to_ascii_lowercase().as_str() {
        "char" => as_type!(i8),
        "unsigned_char" => as_type!(u8),
        "short" => as_type!(i16),
        "unsigned_short" => as_type!(u16),
        // Ids are written in 32 bits, whatever they have in memory.
        "int" | "vtkidtype" => as_type!(i32),
        "unsigned_int" => as_type!(u32),
        "long" | "vtktypeint64" => as_type!(i64),
        "unsigned_long" | "vtktypeuint64" => as_type!(u64),
        "float" => as_type!(f32),
        "double" => (8, |bytes: &[u8]| bytes.try_into().map_or(0.0, f64::from_be_bytes)),
        _ => return None,
    })
}
