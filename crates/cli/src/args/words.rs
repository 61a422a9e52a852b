//! What a word of the command line means.

use std::ffi::OsString;

use espalier_pipeline::{Axis, Override, Stage};

/// An argument such as `-32.7,4,5` is a point, not an option: a blank before it says so, which readers of points pass over.
pub(crate) fn shield_point(argument: OsString) -> OsString {
    let is_point = argument.to_str().is_some_and(|text| {
        let rest = text.strip_prefix('-').unwrap_or_default();
        text.contains(',') && rest.starts_with(|first: char| first.is_ascii_digit() || first == '.')
    });
    if is_point { [OsString::from(" "), argument].into_iter().collect() } else { argument }
}

pub(super) fn parse_point(text: &str) -> Result<[f64; 3], String> {
    let complaint = || "write X,Y,Z in mm, such as 12.5,-40,3".to_owned();
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse().ok().filter(|number: &f64| number.is_finite()).ok_or_else(complaint))
        .collect::<Result<_, _>>()?;
    numbers.try_into().map_err(|_| complaint())
}

pub(super) fn parse_override(text: &str) -> Result<Override, String> {
    let (key, value) = text.split_once('=').ok_or("write KEY=VALUE, such as embed.w_angle=3")?;
    Ok(Override { key: key.trim().to_owned(), value: value.trim().to_owned() })
}

pub(super) fn parse_filter(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("write ENTITY=VALUE, such as desc=airway")?;
    let is_key = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric());
    if is_key {
        Ok((key.to_owned(), value.to_owned()))
    } else {
        Err("an entity has letters and digits".to_owned())
    }
}

pub(super) fn parse_axis(text: &str) -> Result<Axis, String> {
    let complaint = "write KEY=V1,V2,…, such as embed.w_length=0.5,1,2,4";
    let (key, values) = text.split_once('=').ok_or(complaint)?;
    let (mut depth, mut parts) = (0_i32, vec![String::new()]);
    for letter in values.chars() {
        depth += i32::from(matches!(letter, '[' | '{')) - i32::from(matches!(letter, ']' | '}'));
        match parts.last_mut() {
            Some(part) if letter != ',' || depth > 0 => part.push(letter),
            _ => parts.push(String::new()),
        }
    }
    let values: Vec<String> = parts.iter().map(|part| part.trim().to_owned()).collect();
    if key.trim().is_empty() || values.iter().any(String::is_empty) {
        return Err(complaint.to_owned());
    }
    Ok(Axis { key: key.trim().to_owned(), values })
}

pub(super) fn parse_stage(text: &str) -> Result<Stage, String> {
    Stage::from_name(text).ok_or_else(|| {
        let names: Vec<&str> = Stage::ALL.iter().map(|stage| stage.name()).collect();
        format!("there is no such stage; the stages are {}", names.join(", "))
    })
}

/// A size in bytes, with K, M, G or T for powers of 1024.
pub(super) fn parse_size(text: &str) -> Result<u64, String> {
    let complaint = || "write a size such as 800M or 4G".to_owned();
    let (digits, shift) = match text.trim().to_ascii_uppercase().trim_end_matches('B') {
        body if body.ends_with('K') => (body.trim_end_matches('K').to_owned(), 10),
        body if body.ends_with('M') => (body.trim_end_matches('M').to_owned(), 20),
        body if body.ends_with('G') => (body.trim_end_matches('G').to_owned(), 30),
        body if body.ends_with('T') => (body.trim_end_matches('T').to_owned(), 40),
        body => (body.to_owned(), 0),
    };
    let number: u64 = digits.parse().map_err(|_| complaint())?;
    number.checked_mul(1 << shift).filter(|bytes| *bytes > 0).ok_or_else(complaint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes() {
        let values = |text: &str| parse_axis(text).map(|axis| axis.values);
        assert_eq!(values("embed.w_length=0.5, 1,2"), Ok(["0.5", "1", "2"].map(str::to_owned).to_vec()));
        assert_eq!(values("a=[1,2],[3,4]"), Ok(["[1,2]", "[3,4]"].map(str::to_owned).to_vec()));
        for text in ["embed.w_length", "embed.w_length=", "=1,2", "a=1,,2"] {
            assert!(values(text).is_err(), "{text}");
        }
    }

    #[test]
    fn points() {
        assert_eq!(parse_point("1, -2.5,3e1"), Ok([1.0, -2.5, 30.0]));
        for text in ["1,2", "1,2,3,4", "1,2,x", "1,2,inf", ""] {
            assert!(parse_point(text).is_err(), "{text}");
        }
    }

    #[test]
    fn sizes() {
        assert_eq!(parse_size("4G"), Ok(4 << 30));
        assert_eq!(parse_size("800mb"), Ok(800 << 20));
        assert_eq!(parse_size("17"), Ok(17));
        assert!(
            parse_size("0").is_err() && parse_size("many").is_err() && parse_size("99999999999T").is_err()
        );
    }
}
