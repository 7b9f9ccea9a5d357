//! Dates and times of a day as tables and loggers write them.

const DAY_US: i64 = 86_400_000_000;

/// The seconds since 1970, or of the day, of a text of ISO 8601 or of a day with points; none of any other text.
///
/// Days with points are day, month and year (DIN 5008). Days with slashes are none: their order differs by country. Without a
/// zone a time is of UTC. Six digits of a fraction count.
#[must_use]
#[allow(clippy::cast_precision_loss)]
pub fn seconds_of(text: &str) -> Option<f64> {
    let us = if let Some((days, rest)) = day_with_points(text) {
        let time = rest.trim_start_matches([' ', 'T']);
        days * DAY_US + if time.is_empty() { 0 } else { time_of_day(time)? }
    } else {
        let of_day = day_of_iso(text).and_then(|(days, rest)| Some(days * DAY_US + time_behind(rest)?));
        of_day.or_else(|| time_of_day(text))?
    };
    // So many us are exact from 1685 to 2255.
    Some(us as f64 / 1e6)
}

/// The days since 1970 of `1.5.2024` or `01.05.2024` before a blank, a T or the end, and the rest of the text.
fn day_with_points(text: &str) -> Option<(i64, &str)> {
    let (day, rest) = text.split_once('.')?;
    let (month, rest) = rest.split_once('.')?;
    let (year, rest) = rest.split_at_checked(4)?;
    let is_short = |digits: &str| (1..=2).contains(&digits.len());
    if !(is_short(day) && is_short(month) && (rest.is_empty() || rest.starts_with([' ', 'T']))) {
        return None;
    }
    Some((days_since_1970(digits(year)?, digits(month)?, digits(day)?)?, rest))
}

/// The days since 1970 of `2024-05-01` or `20240501`, and the rest of the text.
fn day_of_iso(text: &str) -> Option<(i64, &str)> {
    let (year, rest) = text.split_at_checked(4)?;
    let (rest, is_apart) = rest.strip_prefix('-').map_or((rest, false), |rest| (rest, true));
    let (month, rest) = rest.split_at_checked(2)?;
    let rest = if is_apart { rest.strip_prefix('-')? } else { rest };
    let (day, rest) = rest.split_at_checked(2)?;
    Some((days_since_1970(digits(year)?, digits(month)?, digits(day)?)?, rest))
}

/// The time, us, behind a day and a character between; 0 where nothing follows.
fn time_behind(rest: &str) -> Option<i64> {
    let mut rest = rest.chars();
    match rest.next() {
        None => Some(0),
        Some(between) if between == 'T' || !between.is_alphanumeric() => time_of_day(rest.as_str()),
        Some(_) => None,
    }
}

/// The time of a day, us, less that of its zone.
fn time_of_day(text: &str) -> Option<i64> {
    if let Some(time) = text.strip_suffix('Z') {
        return clock(time);
    }
    match text.find(['+', '-']) {
        None => clock(text),
        Some(at) => {
            let zone = clock(&text[at + 1..])?;
            Some(clock(&text[..at])? - if text[at..].starts_with('-') { -zone } else { zone })
        }
    }
}

/// The us of `10`, `10:15`, `10:15:02`, `10:15:02.010` or `10:15:02,010`, also without colons.
fn clock(text: &str) -> Option<i64> {
    let (main_part, fraction) = match text.split_once(['.', ',']) {
        Some((main_part, fraction)) => (main_part, Some(fraction)),
        None => (text, None),
    };
    let parts: Vec<&str> = match (main_part.contains(':'), main_part.len()) {
        (true, _) => main_part.split(':').collect(),
        (false, 2 | 4 | 6) if main_part.is_ascii() => {
            (0..main_part.len() / 2).map(|k| &main_part[2 * k..2 * k + 2]).collect()
        }
        _ => return None,
    };
    let mut us = 0;
    for (k, part) in parts.iter().enumerate() {
        let (most, each) = [(23, 3_600_000_000), (59, 60_000_000), (59, 1_000_000)].get(k).copied()?;
        us += digits(part).filter(|&n| part.len() == 2 && n <= most)? * each;
    }
    let Some(fraction) = fraction else { return Some(us) };
    if parts.len() != 3 || !fraction.bytes().all(|digit| digit.is_ascii_digit()) {
        return None;
    }
    Some(us + digits(&format!("{fraction:0<6}")[..6]).filter(|_| !fraction.is_empty())?)
}

/// The number that is written in digits alone.
fn digits(text: &str) -> Option<i64> {
    text.parse().ok().filter(|_| text.bytes().all(|digit| digit.is_ascii_digit()))
}

/// The days from 1 January 1970 to a day of the calendar; none if there is no such day.
fn days_since_1970(year: i64, month: i64, day: i64) -> Option<i64> {
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let lengths = [31, 28 + i64::from(leap), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let months = lengths.get(usize::try_from(month - 1).ok()?)?;
    if !(1..=9999).contains(&year) || !(1..=*months).contains(&day) {
        return None;
    }
    let before = year - 1;
    let leaps = before / 4 - before / 100 + before / 400;
    let in_year: i64 = lengths.iter().take(usize::try_from(month - 1).ok()?).sum();
    // 719 162 days passed from 1 January of the year 1.
    Some(365 * before + leaps + in_year + day - 1 - 719_162)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_and_times_of_a_day_are_read_and_other_texts_are_not() {
        for (text, seconds) in [
            ("1970-01-02T00:00:00.5", 86_400.5),
            ("1970-01-01 01:00:00+01:00", 0.0),
            ("1970-01-01T00:30-0030", 3600.0),
            ("19700102T000001Z", 86_401.0),
            ("2024-05-01T10:15:02.010", 1_714_558_502.01),
            ("01.05.2024 10:15:02,010", 1_714_558_502.01),
            ("1.5.2024", 1_714_521_600.0),
            ("2024-02-29", 1_709_164_800.0),
            ("00:01:00.25", 60.25),
            ("00:01:00.1234569", 60.123_456),
            ("0001-01-01", -62_135_596_800.0),
        ] {
            assert_eq!(seconds_of(text), Some(seconds), "{text}");
        }
        for text in [
            "",
            "-",
            "nan",
            "12.5",
            "1",
            "01/02/1970 00:00",
            "2023-02-29",
            "31.04.2024",
            "24:00:00",
            "10:60",
            "10:15:",
            "10:15.5",
            "10:15:02.",
            "2024-05-01T",
            "2024-05-01x10:15",
            "+1.5.2024",
            "2024-5-1",
            "1e5",
            "\u{663}0:15",
            "é",
        ] {
            assert_eq!(seconds_of(text), None, "{text:?}");
        }
    }
}
