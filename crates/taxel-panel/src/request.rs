//! A client's request: its keys, checked, and how it is refused.

use serde_json::{Map, Value, json};

/// Why a request is refused, and which register or key is at fault.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Refusal {
    pub(super) reason: String,
    pub(super) field: Option<String>,
}

impl Refusal {
    pub(super) fn of(field: &str, reason: impl std::fmt::Display) -> Self {
        Self { reason: format!("{field}: {reason}"), field: Some(field.to_owned()) }
    }

    /// Of work that panicked.
    pub(super) fn bug(what: &str) -> Self {
        format!("{what} failed within taxel; please report it").into()
    }

    /// The `refused` message.
    pub(super) fn message(&self, id: &Value, what: &str) -> Value {
        json!({ "type": "refused", "id": id, "what": what, "reason": self.reason, "field": self.field })
    }
}

impl From<String> for Refusal {
    fn from(reason: String) -> Self {
        Self { reason, field: None }
    }
}

impl From<&str> for Refusal {
    fn from(reason: &str) -> Self {
        reason.to_owned().into()
    }
}

impl From<taxel_live::Error> for Refusal {
    fn from(error: taxel_live::Error) -> Self {
        error.to_string().into()
    }
}

pub(super) type Answer<T = ()> = Result<T, Refusal>;

/// The keys of a request.
pub(super) struct Request<'a>(pub(super) &'a Map<String, Value>);

impl<'a> Request<'a> {
    pub(super) fn get(&self, key: &str) -> Option<&'a Value> {
        self.0.get(key)
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.get(key).is_some_and(|value| !value.is_null())
    }

    pub(super) fn whole(&self, key: &str, least: i64, most: i64) -> Answer<i64> {
        let found = self.get(key).and_then(Value::as_i64).filter(|n| (least..=most).contains(n));
        found.ok_or_else(|| Refusal::of(key, format!("must be a whole number from {least} to {most}")))
    }

    pub(super) fn number(&self, key: &str, least: f64, most: f64) -> Answer<f64> {
        let found = self.get(key).and_then(Value::as_f64).filter(|n| (least..=most).contains(n));
        found.ok_or_else(|| Refusal::of(key, format!("must be a number from {least} to {most}")))
    }

    /// A time of the board's clock, us.
    pub(super) fn time(&self, key: &str) -> Answer<i64> {
        self.whole(key, -(1 << 52), 1 << 52)
    }

    /// One time or more.
    pub(super) fn times(&self, key: &str) -> Answer<Vec<i64>> {
        let all = self.get(key).and_then(Value::as_array).filter(|all| !all.is_empty());
        let time = |value: &Value| value.as_i64().filter(|t| (-(1 << 52)..=1 << 52).contains(t));
        let times = all.and_then(|all| all.iter().map(time).collect());
        times.ok_or_else(|| Refusal::of(key, "must be a list of whole numbers within 2^52, one or more"))
    }

    pub(super) fn flag(&self, key: &str) -> Answer<bool> {
        self.get(key).and_then(Value::as_bool).ok_or_else(|| Refusal::of(key, "must be true or false"))
    }

    /// False where the key is absent.
    pub(super) fn optional_flag(&self, key: &str) -> Answer<bool> {
        if self.has(key) { self.flag(key) } else { Ok(false) }
    }

    pub(super) fn text(&self, key: &str, most: usize) -> Answer<&'a str> {
        let fits = |text: &&str| {
            let n = text.chars().count();
            !text.trim().is_empty() && n <= most && !text.chars().any(char::is_control)
        };
        let found = self.get(key).and_then(Value::as_str).filter(fits);
        found.ok_or_else(|| Refusal::of(key, format!("must be a text of 1 to {most} characters")))
    }

    /// None where the key is absent.
    pub(super) fn optional_text(&self, key: &str, most: usize) -> Answer<Option<&'a str>> {
        if self.has(key) { self.text(key, most).map(Some) } else { Ok(None) }
    }

    pub(super) fn object(&self, key: &str) -> Answer<&'a Map<String, Value>> {
        self.get(key).and_then(Value::as_object).ok_or_else(|| Refusal::of(key, "must be an object"))
    }

    /// One taxel or more, as (column, row).
    pub(super) fn taxels(&self, key: &str) -> Answer<Vec<(u16, u16)>> {
        let all = self.get(key).and_then(Value::as_array).filter(|all| !all.is_empty());
        let taxels = all.and_then(|all| all.iter().map(taxel).collect());
        taxels.ok_or_else(|| Refusal::of(key, "must be one taxel or more, each [column, row]"))
    }
}

/// A taxel, [column, row].
pub(super) fn taxel(value: &Value) -> Option<(u16, u16)> {
    let pair = value.as_array().filter(|pair| pair.len() == 2)?;
    let number = |k: usize| pair[k].as_u64().and_then(|n| u16::try_from(n).ok());
    number(0).zip(number(1))
}
